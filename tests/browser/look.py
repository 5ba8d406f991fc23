# SPDX-License-Identifier: MIT
"""Opens all pages of the site in Chromium as wide as on a phone, some also as on a desk.

python3 look.py SITE FOLDER: prints the faults, saves pictures of some pages in the folder.  Faults
are an error of the server or in the console, a picture that is missing, a page wider than the
window, a printed memory address or markup, a search that finds nothing.
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
    "section": "api/Section.html",
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
STATUS = "return performance.getEntriesByType('navigation')[0].responseStatus"
MARKUP = r"return document.body.innerText.match(/\b0x[0-9a-f]{6,}|<function |<class '|:::/g) || []"
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


def look(driver, site, page, width, picture=None):
    """Open a page, save its picture if a path is given; return its faults."""
    wide, high = WIDTHS[width]
    metrics = {"width": wide, "height": high, "deviceScaleFactor": 1, "mobile": width == "phone"}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    driver.get(f"{site}/{page}")
    driver.execute_script(LOAD_ALL)
    wait = WebDriverWait(driver, 20)
    wait.until(lambda driver: driver.execute_script(LOADED))
    wrong = [f"picture {source}" for source in driver.execute_script(BROKEN)]
    wrong += [f"text {found}" for found in driver.execute_script(MARKUP)]
    if (status := driver.execute_script(STATUS)) != 200:
        wrong.append(f"status {status}")
    if page.startswith("search.html?"):
        try:
            wait.until(lambda driver: driver.execute_script(FOUND) > 3)
        except Exception:
            wrong.append("the search finds nothing")
    if (broad := driver.execute_script(WIDTH)) > wide:
        wrong.append(f"{broad} pixels wide, the window has {wide}")
    wrong += [f"console: {entry['message']}" for entry in driver.get_log("browser")]
    if picture:
        driver.save_screenshot(str(picture))
    return [f"{page}, {width}: {what}" for what in wrong]


def main():
    """Look at all pages."""
    root, folder = map(Path, sys.argv[1:])
    all_pages = [str(page.relative_to(root)) for page in root.rglob("*.html")]
    handler = functools.partial(Quiet, directory=root)
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    driver, site = browser(), f"http://127.0.0.1:{server.server_port}"
    try:
        views = [(page, "phone", None) for page in sorted({*all_pages} - {*PAGES.values()})]
        views += [
            (page, width, folder / f"{name}_{width}.png")
            for name, page in PAGES.items()
            for width in WIDTHS
        ]
        wrong = [line for view in views for line in look(driver, site, *view)]
    finally:
        driver.quit()
    print(f"{len(views)} views of {len(all_pages)} pages, {len(wrong)} faults", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
