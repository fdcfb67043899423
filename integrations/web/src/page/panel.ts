/** The texts and buttons over the picture. Names from the network are set as text, never as HTML. */

import * as THREE from "three";

import { performerColour, Skeletons } from "./performers.js";
import type { CastEntry, Theatre } from "./theatre.js";

/** Returns the element of the page with that id. */
export function element<T extends HTMLElement = HTMLElement>(id: string): T {
  const result = document.getElementById(id);
  if (result === null) throw new Error(`the page has no element ${id}`);
  return result as T;
}

/** Returns a new element with a class and a text. */
function make(tag: string, className: string, text = ""): HTMLElement {
  const result = document.createElement(tag);
  result.className = className;
  result.textContent = text;
  return result;
}

/** The list of characters, the state of the connection, and the numbers above heads. */
export class Panel {
  private listed = "";
  private readonly labels = new Map<string, HTMLElement>();

  /** @param showsFree true if characters without performer are marked as free. */
  constructor(private readonly theatre: Theatre, private readonly showsFree: boolean) {
    const { stage } = theatre;
    element("reset").onclick = () => {
      stage.reset();
      theatre.refit();
    };
    const skeletons = element<HTMLButtonElement>("skeletons");
    skeletons.onclick = () => {
      const isOn = skeletons.getAttribute("aria-pressed") !== "true";
      skeletons.setAttribute("aria-pressed", String(isOn));
      theatre.skeletonsVisible = isOn;
    };
    stage.afterDraw.push(() => this.placeLabels());
  }

  /** Shows the state: a colour ("good", "wait" or "bad") and one sentence. */
  setState(kind: "good" | "wait" | "bad", text: string): void {
    element("state").dataset.kind = kind;
    element("state-text").textContent = text;
  }

  /** Updates the list of characters. */
  update(): void {
    const cast = this.theatre.cast();
    const text = JSON.stringify(cast);
    if (text === this.listed) return;
    this.listed = text;
    element("cast").replaceChildren(...cast.map((entry) => this.row(entry)));
    element("cast-empty").hidden = cast.length > 0;
  }

  private row({ id, performers }: CastEntry): HTMLElement {
    const row = make("li", performers.length ? "held" : "free");
    row.append(make("span", "name", id));
    if (!performers.length && this.showsFree) row.append(make("span", "holder", "free"));
    for (const number of performers) {
      const badge = make("span", "badge", String(number));
      badge.style.setProperty("--colour", performerColour(number));
      badge.title = `controlled by performer ${number}`;
      row.append(badge);
    }
    return row;
  }

  /** Places the numbers above the heads of performers. */
  private placeLabels(): void {
    const { stage, bodies, numbers } = this.theatre;
    const { clientWidth, clientHeight } = stage.renderer.domElement;
    const wanted = new Map<string, THREE.Vector3>();
    const isShown = element("skeletons").getAttribute("aria-pressed") === "true";
    for (const body of isShown ? bodies : []) wanted.set(String(numbers.of(body.id)), Skeletons.labelPlace(body));
    for (const [number, label] of this.labels) {
      if (wanted.has(number)) continue;
      label.remove();
      this.labels.delete(number);
    }
    for (const [number, place] of wanted) {
      let label = this.labels.get(number);
      if (label === undefined) {
        label = make("div", "label", number);
        label.style.setProperty("--colour", performerColour(Number(number)));
        element("labels").append(label);
        this.labels.set(number, label);
      }
      const seen = place.clone().project(stage.camera);
      label.hidden = seen.z > 1;
      const x = ((seen.x + 1) / 2) * clientWidth;
      const y = ((1 - seen.y) / 2) * clientHeight;
      label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }
}
