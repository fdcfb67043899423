/**
 * The live page: a WebSocket to the bridge of `enliven web`.
 *
 * The bridge sends batches, arrays [number, messages] in MessagePack. Each message has the bytes of the stream
 * socket. Two topics exist only here: "character" has the payload of an edge's reply, and "surface" the solved
 * vertices of a mesh that control points drive. The page answers each drawn batch with its number. The bridge
 * waits for these answers, so that a slow or hidden page gets fewer, but current messages.
 */

import { decode } from "@msgpack/msgpack";

import { OtherVersionError, readCharacter, readStream, splitStream, type PoseMessage } from "../reader/index.js";
import type { Panel } from "./panel.js";
import { element } from "./panel.js";
import type { Theatre } from "./theatre.js";

/** Milliseconds until the page connects again. The pause doubles up to the maximum, and starts again after success. */
const MIN_PAUSE_MS = 300;
const MAX_PAUSE_MS = 3000;
/** Number of poses over which the delay is averaged. */
const DELAY_SAMPLES = 200;

/** What the page has received, for tests and measurements. */
export interface LiveStatistics {
  batches: number;
  bytes: number;
  poses: number;
  /** Milliseconds from the edge's clock at sending to the decoded pose, of the newest poses. */
  delays: number[];
  connections: number;
  refused: number;
}

/** State of the edge as the bridge reports it, in JSON. */
interface BridgeState {
  state: string;
  text: string;
  edge: string;
  characters: string[];
}

/** Returns the token in the address of the page, or an empty text. */
const pageToken = (): string => new URLSearchParams(location.hash.slice(1)).get("token") ?? "";

/** Receives the stream of the bridge, and connects again after every interruption. */
export class LiveConnection {
  readonly statistics: LiveStatistics = { batches: 0, bytes: 0, poses: 0, delays: [], connections: 0, refused: 0 };
  private readonly revisions = new Map<string, number>();
  private readonly poses = new Map<string, PoseMessage>();
  private readonly surfaces = new Map<string, Float32Array>();
  private socket: WebSocket | null = null;
  private drawn: number[] = [];
  private pause = MIN_PAUSE_MS;

  constructor(private readonly theatre: Theatre, private readonly panel: Panel) {
    theatre.stage.beforeDraw.push(() => this.apply());
    this.connect();
  }

  private connect(): void {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const token = encodeURIComponent(pageToken());
    const socket = new WebSocket(`${scheme}://${location.host}/live?token=${token}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.pause = MIN_PAUSE_MS;
      this.statistics.connections++;
      this.revisions.clear();
    };
    socket.onmessage = ({ data }) => this.receive(data);
    socket.onclose = ({ code }) => {
      const isRefused = code === 4401;
      const text = isRefused ? "Wrong address: open the one that enliven web printed." : "Connecting to enliven web ...";
      this.panel.setState(isRefused ? "bad" : "wait", text);
      setTimeout(() => this.connect(), this.pause);
      this.pause = Math.min(2 * this.pause, MAX_PAUSE_MS);
    };
    this.socket = socket;
    this.drawn = [];
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      this.setState(JSON.parse(data));
      return;
    }
    this.statistics.batches++;
    this.statistics.bytes += data.byteLength;
    const [number, messages] = decode(new Uint8Array(data)) as [number, Uint8Array[]];
    this.drawn.push(number);
    for (const message of messages) {
      try {
        this.read(message);
      } catch (error) {
        this.statistics.refused++;
        if (error instanceof OtherVersionError) this.panel.setState("bad", error.message);
        else console.warn(error);
      }
    }
  }

  private setState({ state, text, edge, characters }: BridgeState): void {
    const isGood = state === "connected" || state === "on rate";
    this.panel.setState(isGood ? "good" : state === "waiting" || state === "stale" || state === "ended" ? "wait" : "bad", text);
    document.title = edge ? `${edge} · enliven` : "enliven";
    this.theatre.keepCharacters(characters);
    for (const id of this.revisions.keys()) if (!characters.includes(id)) this.revisions.delete(id);
    if (!isGood) this.theatre.setBodies([]);
    this.panel.update();
  }

  private read(data: Uint8Array): void {
    const { topic, payload } = splitStream(data);
    if (topic === "character") {
      const character = readCharacter(payload);
      this.revisions.set(character.id, character.revision);
      this.theatre.setCharacter(character);
    } else if (topic === "surface") {
      const [id, revision, low, step, steps] = decode(payload) as [string, number, number[], number, Uint8Array];
      if (this.revisions.get(id) !== revision) return;
      const grid = new Uint16Array(steps.slice().buffer);
      this.surfaces.set(id, Float32Array.from(grid, (value, at) => low[at % 3] + step * value));
    } else {
      this.readStreamMessage(data);
    }
  }

  private readStreamMessage(data: Uint8Array): void {
    const message = readStream(data);
    if (message.topic === "pose") {
      if (this.revisions.get(message.value.character) === message.value.revision) {
        this.poses.set(message.value.character, message.value);
      }
    } else if (message.topic === "bodies") this.theatre.setBodies(message.value.bodies);
    else if (message.topic === "cues") this.theatre.setCues(message.value);
    else if (message.topic === "props") this.theatre.setProps(message.value);
    if (message.topic === "cues" || message.topic === "bodies") this.panel.update();
  }

  /** Decodes the newest pose of each character, and reports the batches that the next picture shows. */
  private apply(): boolean {
    const { statistics } = this;
    for (const [id, message] of this.poses) {
      const figure = this.theatre.figures.get(id);
      if (figure === undefined) continue;
      this.theatre.setPose(id, figure.character.decoder.decode(message.transforms));
      statistics.poses++;
      statistics.delays.push(performance.timeOrigin + performance.now() - message.publishedNs / 1e6);
      if (statistics.delays.length > DELAY_SAMPLES) statistics.delays.shift();
    }
    for (const [id, vertices] of this.surfaces) this.theatre.setSurface(id, vertices);
    this.poses.clear();
    this.surfaces.clear();
    if (this.drawn.length && this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(String(Math.max(...this.drawn)));
      this.drawn = [];
      this.panel.update();
    }
    return false;
  }
}

/** Shows the button of the QR code if the page can be opened from other machines. */
export async function addShare(): Promise<void> {
  const token = pageToken();
  const response = await fetch(`share.json?token=${encodeURIComponent(token)}`).catch(() => null);
  if (response === null || !response.ok) return;
  const { address, qr } = (await response.json()) as { address: string; qr: string };
  if (!address) return;
  element("share").hidden = false;
  element<HTMLImageElement>("qr").src = qr;
  element("address").textContent = token ? `${address}#token=${token}` : address;
  element("share").onclick = () => element<HTMLDialogElement>("share-dialog").showModal();
}
