# SPDX-License-Identifier: MIT
"""Opens pages of the site in Chromium, as wide as on a desk and on a phone, and says what is wrong.

python3 look.py SITE FOLDER: pictures of the pages go to the folder.  Wrong are: errors in the
console, pictures that are not there, pages wider than the window, a search that finds nothing.
"""

import functools
import sys
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.support.ui import WebDriverWait

PAGES = {
    "first_page": "index.html",
    "gallery": "gallery.html",
    "demo": "demos/demo_hinge_snapback.html",
    "demo_roll_up": "demos/demo_roll_up.html",
    "demo_lee_frame": "demos/demo_lee_frame.html",
    "reference": "reference.html",
    "reference_page": "api/Softening.html",
    "theory": "theory.html",
    "start": "start.html",
    "notebook": "notebooks/first_steps.html",
    "howto": "howto_pushover.html",
    "coming_from": "coming_from.html",
    "search": "search.html?q=hinge",  # the last one: other pages would highlight the word, too
}
WIDTHS = {"desk": (1280, 900), "phone": (390, 844)}

BROKEN = "return [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)"
WIDTH = "return document.documentElement.scrollWidth"
FOUND = "return document.querySelectorAll('#search-results li').length"
LOAD_ALL = "document.querySelectorAll('img').forEach(i => i.loading = 'eager')"
LOADED = "return [...document.images].every(i => i.complete)"


class Quiet(SimpleHTTPRequestHandler):
    """A server that does not report requests."""

    def log_message(self, *args):
        """Say nothing."""


def browser():
    """A Chromium without a window."""
    options = webdriver.ChromeOptions()
    for option in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService("/usr/bin/chromedriver")
    return webdriver.Chrome(options=options, service=service)


def look(driver, site, name, page, width, folder):
    """Open a page, take its picture; what is wrong with it."""
    wide, high = WIDTHS[width]
    metrics = {"width": wide, "height": high, "deviceScaleFactor": 1, "mobile": width == "phone"}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    driver.get(f"{site}/{page}")
    driver.execute_script(LOAD_ALL)
    wait = WebDriverWait(driver, 20)
    wait.until(lambda driver: driver.execute_script(LOADED))
    wrong = [f"picture {source}" for source in driver.execute_script(BROKEN)]
    if name == "search":
        try:
            wait.until(lambda driver: driver.execute_script(FOUND) > 3)
        except Exception:
            wrong.append("the search finds nothing")
    if (broad := driver.execute_script(WIDTH)) > wide:
        wrong.append(f"{broad} pixels wide, the window has {wide}")
    wrong += [f"console: {entry['message']}" for entry in driver.get_log("browser")]
    driver.save_screenshot(str(folder / f"{name}_{width}.png"))
    return [f"{page}, {width}: {what}" for what in wrong]


def main():
    """Look at all pages."""
    root, folder = map(Path, sys.argv[1:])
    handler = functools.partial(Quiet, directory=root)
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    driver, site = browser(), f"http://127.0.0.1:{server.server_port}"
    try:
        wrong = [
            line
            for name, page in PAGES.items()
            for width in WIDTHS
            for line in look(driver, site, name, page, width, folder)
        ]
    finally:
        driver.quit()
    print(f"{len(PAGES) * len(WIDTHS)} views, {len(wrong)} faults", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
