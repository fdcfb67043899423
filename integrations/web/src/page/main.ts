/** Entry of the page: live if the page comes from a bridge, otherwise the take inside the file. */

import { addShare, LiveConnection } from "./live.js";
import { element, Panel } from "./panel.js";
import { Stage } from "./stage.js";
import { TakePlayer } from "./take.js";
import { Theatre } from "./theatre.js";

async function start(): Promise<void> {
  const take = document.getElementById("take");
  const theatre = new Theatre(new Stage(element<HTMLCanvasElement>("picture")));
  const panel = new Panel(theatre, take === null);
  const page: Record<string, unknown> = { theatre };
  // For tests, and for people that open the console of the browser.
  (window as any).enliven = page;
  if (take === null) {
    page.live = new LiveConnection(theatre, panel);
    await addShare();
  } else {
    element("skeletons").hidden = true;
    page.take = await TakePlayer.open(theatre, panel, take.textContent ?? "");
  }
}

start().catch((error: unknown) => {
  element("state").dataset.kind = "bad";
  element("state-text").textContent = `This page needs a current browser with WebGL 2. (${error})`;
});
