"""Measure how smooth the studio is: `python -m benchmarks.studio [seconds]`, in headless Chromium by Playwright.

First sight is the time from the beginning of the page's loading to the first motion shown. The verdict is the time from a
change of a dimension to its Floquet multipliers on the page. Frames are the times between frames while a joint is dragged, its
path and forces are drawn anew, and a stability chart is computed in parallel.

A display of 60 frames a second shows one every 16.67 ms; a clock with a resolution of 0.1 ms reads 16.6 to 16.8 ms. Whether the
page keeps up is seen from the processor time of its own thread for each frame (events, scripts, layout and paint, by the
browser's trace), and from the number of late frames.
"""

import json
import math
import shutil
import sys
import time
from typing import Any, NamedTuple

import numpy as np

from analysis.studio import PAGE


class Figures(NamedTuple):
    """Measured times of the page (ms).

    ``first`` is the first sight, ``verdict`` the median and greatest time to a verdict. ``frame`` is the time between frames of
    a drag, ``work`` the processor time of the page's own thread for each frame; both are median, 95th percentile and greatest
    value. ``late`` is the share of late frames, ``squares`` the number of squares of the chart computed during the drag.
    """

    first: float
    verdict: tuple[float, float]
    frame: tuple[float, float, float]
    work: tuple[float, float, float]
    late: float
    squares: int


#: Time between two frames of a display (ms).
REFRESH = 1000.0 / 60.0


#: Script that measures the times from a change to its verdict; each change is made when the page is at rest.
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
    """Return the path of the system's Chromium, or None without one."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def measure_page(browser: Any, seconds: float = 4.0) -> Figures:
    """Measure the built page in a browser of Playwright; ``seconds`` is the length of the drag."""
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.goto(PAGE.as_uri())
    page.wait_for_function("document.documentElement.dataset.ready", timeout=120_000)
    first = float(page.evaluate("Number(document.documentElement.dataset.ready)"))
    page.click("#play")
    verdicts = page.evaluate(_VERDICTS, 20)
    # the chart is computed in its worker while the page shows the forces
    page.click('[id="tab stability"]')
    page.wait_for_function("window.studio.charts.stability.cells.size > 0", timeout=120_000)
    page.click('[id="tab forces"]')
    already = page.evaluate("window.studio.charts.stability.cells.size")
    box = page.locator('[data-joint="C"] .pin').bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(_FRAMES)
    browser.start_tracing(page=page, categories=["toplevel", "disabled-by-default-devtools.timeline", "__metadata"])
    begun = time.perf_counter()
    while (now := time.perf_counter() - begun) < seconds:
        page.mouse.move(x + 25.0 * math.sin(3.0 * now), y + 15.0 * math.sin(4.0 * now))
    work = _work(json.loads(browser.stop_tracing())["traceEvents"])
    page.mouse.up()
    frames = np.array(page.evaluate("window.frames_.slice(2)"))
    squares = page.evaluate("window.studio.charts.stability.cells.size") - already
    page.close()
    verdict, late = (float(np.median(verdicts)), float(max(verdicts))), float(np.mean(frames > 1.5 * REFRESH))
    return Figures(first, verdict, _spread(frames), _spread(work), late, int(squares))


def _spread(values: np.ndarray) -> tuple[float, float, float]:
    return float(np.median(values)), float(np.quantile(values, 0.95)), float(values.max())


def _work(events: list[dict[str, Any]]) -> np.ndarray:
    """Return the processor time of the page's own thread for each frame (ms), from the browser's trace."""
    commits = [e for e in events if e["name"] == "Commit"]
    thread = max((e["pid"], e["tid"]) for e in commits)
    ends = np.sort([e["ts"] for e in commits if (e["pid"], e["tid"]) == thread])
    tasks = [e for e in events if e["name"] == "ThreadControllerImpl::RunTask" and (e["pid"], e["tid"]) == thread]
    frame = np.searchsorted(ends, [e["ts"] for e in tasks])
    return np.bincount(frame, [e.get("tdur", 0) / 1e3 for e in tasks], len(ends) + 1)[1:-1]


def figures_in_words(found: Figures) -> str:
    """Return the measured times as one sentence."""
    return (
        f"first sight {found.first:.0f} ms; Floquet verdict {found.verdict[0]:.1f} ms after a change (greatest "
        f"{found.verdict[1]:.1f}); frames of a drag {found.frame[0]:.1f} ms, p95 {found.frame[1]:.1f}, greatest "
        f"{found.frame[2]:.1f}, {100.0 * found.late:.1f} % of them late; work for each {found.work[0]:.1f} ms, "
        f"p95 {found.work[1]:.1f}, greatest {found.work[2]:.1f}; while {found.squares} squares of a chart were computed"
    )


def main() -> None:
    """Measure the page three times, and print the results."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        for _ in range(3):
            print(figures_in_words(measure_page(browser, float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)))
        browser.close()


if __name__ == "__main__":
    main()
