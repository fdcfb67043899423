/** Everything on the stage: characters, performers and props, from messages or from a take. */

import * as THREE from "three";

import { type Body, type Character, type CuesMessage, type Pose, type PropsMessage } from "../reader/index.js";
import { Figure } from "./figure.js";
import { PerformerNumbers, Skeletons } from "./performers.js";
import { Props } from "./props.js";
import { Stage } from "./stage.js";

/** Seconds between two fits of the camera to the characters. */
const FIT_INTERVAL_S = 0.5;
/** Change of the characters' box, as a fraction of its size, from which on the camera follows. */
const FIT_TOLERANCE = 0.12;

/** A character in the list of the panel. */
export interface CastEntry {
  id: string;
  /** Numbers of the performers that control it. */
  performers: number[];
}

/** The content of the stage. */
export class Theatre {
  readonly numbers = new PerformerNumbers();
  readonly figures = new Map<string, Figure>();
  bodies: Body[] = [];
  private readonly skeletons = new Skeletons();
  private readonly props = new Props();
  private readonly holders = new Map<string, number[]>();
  private nextFit = 0;
  private fitted = new THREE.Box3();

  constructor(readonly stage: Stage) {
    stage.scene.add(this.skeletons.group, this.props.group);
    stage.resized = () => this.refit();
    stage.beforeDraw.push((now) => {
      if (now >= this.nextFit) this.fit(now);
      return false;
    });
  }

  /** Adds a character, or replaces its older revision. */
  setCharacter(character: Character): void {
    this.figures.get(character.id)?.dispose();
    const figure = new Figure(character, () => this.stage.invalidate());
    this.figures.set(character.id, figure);
    this.stage.scene.add(figure.mesh);
    this.nextFit = 0;
    this.stage.invalidate();
  }

  /** Removes all characters that are not listed. */
  keepCharacters(ids: Iterable<string>): void {
    const kept = new Set(ids);
    for (const [id, figure] of this.figures) {
      if (kept.has(id)) continue;
      figure.dispose();
      this.figures.delete(id);
      this.holders.delete(id);
      this.nextFit = 0;
      this.stage.invalidate();
    }
  }

  setPose(id: string, pose: Pose): void {
    this.figures.get(id)?.show(pose);
    this.stage.invalidate();
  }

  setSurface(id: string, vertices: Float32Array): void {
    this.figures.get(id)?.showSurface(vertices);
    this.stage.invalidate();
  }

  setBodies(bodies: Body[]): void {
    this.bodies = bodies;
    this.updateNumbers();
    this.skeletons.show(bodies, this.numbers);
    this.stage.invalidate();
  }

  setCues({ character, state, performers }: CuesMessage): void {
    this.holders.set(character, state === "possessed" ? performers : []);
    this.updateNumbers();
  }

  setProps(message: PropsMessage): void {
    this.props.show(message);
    this.stage.invalidate();
  }

  /** Shows or hides the skeletons of the performers. */
  set skeletonsVisible(isVisible: boolean) {
    this.skeletons.group.visible = isVisible;
    this.stage.invalidate();
  }

  /** Returns the characters with the numbers of their performers, sorted by id. */
  cast(): CastEntry[] {
    return [...this.figures.keys()].sort().map((id) => ({
      id, performers: (this.holders.get(id) ?? []).map((body) => this.numbers.of(body)).sort(),
    }));
  }

  /** Returns the box around everything. */
  box(): THREE.Box3 {
    const box = new THREE.Box3();
    for (const figure of this.figures.values()) if (figure.mesh.visible) box.union(figure.box());
    for (const { joints } of this.skeletons.group.visible ? this.bodies : []) {
      box.union(new THREE.Box3().setFromArray(joints));
    }
    return box;
  }

  private updateNumbers(): void {
    this.numbers.see([...this.bodies.map((body) => body.id), ...[...this.holders.values()].flat()]);
  }

  /** Fits light and camera to the characters if they have moved or changed much. */
  private fit(now: number): void {
    this.nextFit = now + FIT_INTERVAL_S;
    const box = this.box();
    if (box.isEmpty()) return;
    const size = box.getSize(new THREE.Vector3()).length();
    const change = this.fitted.isEmpty()
      ? Infinity
      : this.fitted.min.distanceTo(box.min) + this.fitted.max.distanceTo(box.max);
    if (change < FIT_TOLERANCE * size) return;
    const isFirst = this.fitted.isEmpty();
    this.fitted = box;
    if (this.stage.isHeld) this.stage.placeLight(box);
    else this.stage.frame(box, isFirst);
  }

  /** Fits the camera at the next picture, also if nothing has moved. */
  refit(): void {
    this.fitted = new THREE.Box3();
    this.nextFit = 0;
  }
}
