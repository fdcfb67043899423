// Replaces the content of the page by its newest state. Without JavaScript the page reloads itself.
"use strict";
const INTERVAL_MS = 5000;

// Returns a function that finds the element with the focus again in a new version of the page.
function focusFinder() {
  const element = document.activeElement;
  const href = element?.getAttribute("href");
  if (href) return (page) => page.querySelector(`a[href="${CSS.escape(href)}"]`);
  const details = element?.closest("details[id]");
  if (details) return (page) => page.querySelector(`#${CSS.escape(details.id)} > summary`);
  return element?.matches("pre") ? (page) => page.querySelector("pre") : () => null;
}

function show(fresh) {
  const main = document.getElementById("health");
  for (const details of main.querySelectorAll("details[id]")) {
    const same = fresh.querySelector(`#${CSS.escape(details.id)}`);
    if (same) same.open = details.open;
  }
  const log = main.querySelector("pre");
  const fromEnd = log ? log.scrollHeight - log.scrollTop : 0;
  const find = focusFinder();
  main.replaceWith(fresh);
  const newLog = fresh.querySelector("pre");
  if (newLog) newLog.scrollTop = newLog.scrollHeight - fromEnd;
  find(fresh)?.focus({ preventScroll: true });
}

async function refresh() {
  try {
    const answer = await fetch("/", { cache: "no-store", credentials: "same-origin" });
    if (!answer.ok) throw new Error(answer.status);
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    // Text that is being selected stays until the next turn.
    if (!String(document.getSelection())) {
      show(page.getElementById("health"));
      document.title = page.title;
    }
    document.getElementById("lost").hidden = true;
  } catch {
    document.getElementById("lost").hidden = false;
  }
  setTimeout(refresh, INTERVAL_MS);
}

const first = document.querySelector("pre");
if (first) first.scrollTop = first.scrollHeight;
setTimeout(refresh, INTERVAL_MS);
