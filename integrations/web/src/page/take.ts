/**
 * The page of `enliven export ... -o show.html`: a take inside the file, with play, pause and a time line.
 *
 * The element `take` contains gzip in base64. Unpacked, it is a map in MessagePack:
 *   title: text.
 *   seconds: length of the take.
 *   characters: a list of maps with `payload` (the bytes of a character message), `times` (float64 seconds), and
 *     `poses` (the coded transforms at each time).
 */

import { decode } from "@msgpack/msgpack";

import { readCharacter, type Character } from "../reader/index.js";
import { element, type Panel } from "./panel.js";
import type { Theatre } from "./theatre.js";

interface Track {
  character: Character;
  times: Float64Array;
  poses: Uint8Array[];
  /** Index of the shown pose. */
  shown: number;
}

/** Returns the unpacked data of the file. */
async function unpack(text: string): Promise<any> {
  const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return decode(new Uint8Array(await new Response(stream).arrayBuffer()));
}

/** Returns the index of the last time that is not later than `seconds`. */
function indexAt(times: Float64Array, seconds: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= seconds + 1e-6) low = middle;
    else high = middle - 1;
  }
  return low;
}

const clock = (seconds: number): string =>
  `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}.${Math.floor((seconds % 1) * 10)}`;

/** Plays a take in a loop. */
export class TakePlayer {
  private readonly slider = element<HTMLInputElement>("time");
  private position = 0;
  private isPlaying = true;
  private last: number | null = null;

  private constructor(private readonly theatre: Theatre, private readonly tracks: Track[], readonly seconds: number) {
    element("transport").hidden = false;
    this.slider.max = String(seconds);
    this.slider.step = "any";
    this.slider.oninput = () => this.seek(Number(this.slider.value));
    element("play").onclick = () => this.setPlaying(!this.isPlaying);
    window.addEventListener("keydown", (event) => this.press(event));
    theatre.stage.beforeDraw.push((now) => this.step(now));
    this.setPlaying(true);
    this.seek(0);
  }

  /** Reads the take of the page. */
  static async open(theatre: Theatre, panel: Panel, text: string): Promise<TakePlayer> {
    const { title, seconds, characters } = await unpack(text);
    document.title = `${title} · enliven`;
    const tracks: Track[] = characters.map(({ payload, times, poses }: any) => ({
      character: readCharacter(payload), times: new Float64Array(times.slice().buffer), poses, shown: -1,
    }));
    for (const { character } of tracks) theatre.setCharacter(character);
    panel.setState("good", title);
    panel.update();
    return new TakePlayer(theatre, tracks, seconds);
  }

  /** Shows the take at a time in seconds. */
  seek(seconds: number): void {
    this.position = Math.min(Math.max(seconds, 0), this.seconds);
    for (const track of this.tracks) {
      const index = indexAt(track.times, this.position);
      if (index === track.shown) continue;
      track.shown = index;
      this.theatre.setPose(track.character.id, track.character.decoder.decode(track.poses[index]));
    }
    this.slider.value = String(this.position);
    this.slider.style.setProperty("--played", `${(100 * this.position) / (this.seconds || 1)}%`);
    element("clock").textContent = `${clock(this.position)} / ${clock(this.seconds)}`;
  }

  /** Plays or pauses. */
  setPlaying(isPlaying: boolean): void {
    this.isPlaying = isPlaying;
    this.last = null;
    element("play").dataset.playing = String(isPlaying);
    element("play").setAttribute("aria-label", isPlaying ? "Pause" : "Play");
  }

  private step(now: number): boolean {
    if (this.isPlaying && this.last !== null) {
      const next = this.position + now - this.last;
      this.seek(next > this.seconds ? 0 : next);
    }
    this.last = now;
    return false;
  }

  private press(event: KeyboardEvent): void {
    const steps: Record<string, () => void> = {
      " ": () => this.setPlaying(!this.isPlaying),
      ArrowLeft: () => this.seek(this.position - 0.5),
      ArrowRight: () => this.seek(this.position + 0.5),
      Home: () => this.seek(0),
    };
    if (!(event.key in steps)) return;
    event.preventDefault();
    steps[event.key]();
  }
}
