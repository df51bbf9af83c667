"""How smooth the studio is: `python -m benchmarks.studio [seconds]`, in headless Chromium by Playwright.

First sight is the time from the beginning of the page's loading to the first motion shown; the verdict is the time from a
change of a dimension to its Floquet multipliers on the page; frames are the times between frames while a joint is dragged with
its path and forces drawn anew, and a stability chart is computed beside it.
"""

from __future__ import annotations

import math
import shutil
import sys
import time
from typing import Any, NamedTuple

import numpy as np

from analysis.studio import PAGE


class Figures(NamedTuple):
    """All in ms: first sight, verdicts after changes (median and greatest), frames of a drag (median, p95, greatest), and the
    processor time that the page's own thread has for one, whatever else the machine does.
    """

    first: float
    verdict: tuple[float, float]
    frame: tuple[float, float, float]
    work: float
    squares: int


#: Times from a change to its verdict: each change is made when the page is at rest.
_VERDICTS = """async (count) => {
  const root = document.documentElement, times = [];
  const field = document.getElementById("field crank.length");
  for (let n = 0; n < count; n++) {
    const before = Number(root.dataset.answer);
    field.value = String(50 + 0.1 * n);
    const begun = performance.now();
    field.dispatchEvent(new Event("change"));
    while (!(Number(root.dataset.answer) > before && root.dataset.settled === "true"))
      await new Promise((resolve) => setTimeout(resolve));
    times.push(performance.now() - begun);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  return times;
}"""
_FRAMES = """() => {
  window.frames_ = [];
  let last = performance.now();
  const frame = (now) => { window.frames_.push(now - last); last = now; requestAnimationFrame(frame); };
  requestAnimationFrame(frame);
}"""


def chromium() -> str | None:
    """The system's Chromium."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def measured(browser: Any, seconds: float = 4.0) -> Figures:
    """The figures of the built page in a browser of Playwright."""
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.goto(PAGE.as_uri())
    page.wait_for_function("document.documentElement.dataset.ready", timeout=120_000)
    first = float(page.evaluate("Number(document.documentElement.dataset.ready)"))
    page.click("#play")
    verdicts = page.evaluate(_VERDICTS, 20)
    # the chart goes on in its worker while the forces are looked at
    page.click('[id="tab stability"]')
    page.wait_for_function("window.studio.charts.stability.cells.size > 0", timeout=120_000)
    page.click('[id="tab forces"]')
    already = page.evaluate("window.studio.charts.stability.cells.size")
    box = page.locator('[data-joint="C"] .pin').bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(_FRAMES)
    tasks = page.context.new_cdp_session(page)
    tasks.send("Performance.enable", {"timeDomain": "threadTicks"})

    def worked() -> float:
        return next(
            float(m["value"]) for m in tasks.send("Performance.getMetrics")["metrics"] if m["name"] == "TaskDuration"
        )

    before, begun = worked(), time.perf_counter()
    while (now := time.perf_counter() - begun) < seconds:
        page.mouse.move(x + 25.0 * math.sin(3.0 * now), y + 15.0 * math.sin(4.0 * now))
    work = worked() - before
    page.mouse.up()
    frames = np.array(page.evaluate("window.frames_.slice(2)"))
    squares = page.evaluate("window.studio.charts.stability.cells.size") - already
    page.close()
    return Figures(
        first,
        (float(np.median(verdicts)), float(max(verdicts))),
        (float(np.median(frames)), float(np.quantile(frames, 0.95)), float(frames.max())),
        1e3 * work / len(frames),
        int(squares),
    )


def report(found: Figures) -> str:
    """The figures in words."""
    return (
        f"first sight {found.first:.0f} ms; Floquet verdict {found.verdict[0]:.1f} ms after a change (greatest "
        f"{found.verdict[1]:.1f}); frames of a drag {found.frame[0]:.1f} ms, p95 {found.frame[1]:.1f}, greatest "
        f"{found.frame[2]:.1f}, {found.work:.1f} ms of the processor each, "
        f"while {found.squares} squares of a chart were computed"
    )


def main() -> None:
    """Print the figures of three openings of the page."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        for _ in range(3):
            print(report(measured(browser, float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)))
        browser.close()


if __name__ == "__main__":
    main()
