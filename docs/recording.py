"""Record the animation in README.md: `python docs/recording.py` writes docs/studio.webp; it needs Chromium.

It opens the studio's page with a published set and a coupler point, and takes screenshots over one turn of the crank.
"""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

from analysis.files import write_text
from analysis.run import read_case
from analysis.studio import make_page, page_state

TARGET = Path(__file__).resolve().parent / "studio.webp"
#: Width and height of the page (pixels), and scale of the animation relative to the page.
WIDTH, HEIGHT, SHARE = 1240, 890, 0.7
#: Number of frames, and how long each is shown (ms).
PICTURES, SHOWN = 40, 60


def main() -> None:
    """Write the animation."""
    browser_path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    point = {"point_distance": "12 cm", "point_angle": "30 deg"}
    machine = read_case({"published": "table-3.1", "coupler": point}, folder=Path())
    pictures = []
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = write_text(Path(folder) / "studio.html", make_page(page_state(machine)))
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        tab.goto(path.resolve().as_uri())
        tab.locator("#floquet", has_text="stable").wait_for()
        tab.locator("#play").click()
        for picture in range(PICTURES):
            tab.locator("#scrub").evaluate(
                "(e, share) => { e.value = Math.round(share * e.max); e.dispatchEvent(new Event('input')) }",
                picture / PICTURES,
            )
            shot = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
            pictures.append(shot.resize((int(SHARE * WIDTH), int(SHARE * HEIGHT)), Image.Resampling.LANCZOS))
        browser.close()
    pictures[0].save(
        TARGET,
        save_all=True,
        append_images=pictures[1:],
        duration=SHOWN,
        loop=0,
        quality=45,
        method=6,
        minimize_size=True,
    )


if __name__ == "__main__":
    main()
