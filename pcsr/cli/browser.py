"""Opening a page in the person's browser, where there is one."""

import os
import subprocess
import sys
import threading
from pathlib import Path

OPEN = "import sys, webbrowser; sys.exit(not webbrowser.open(sys.argv[1]))"
"""Program that opens a page, and fails if there is no browser."""
PATIENCE = 10.0
"""Seconds to wait for it. One that runs on is itself the browser."""


def has_browser() -> bool:
    """Return whether a page may be opened: by `$BROWSER`, or on a desktop of this machine."""
    if os.environ.get("BROWSER"):
        return True
    if any(os.environ.get(name) for name in ("SSH_CONNECTION", "SSH_TTY")):
        return False
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_page(path: Path) -> bool:
    """Open a page in a process of its own, so that no browser can hold the command up.

    Returns:
        Whether a browser took it.
    """
    if not has_browser():
        return False
    try:
        process = subprocess.Popen(
            [sys.executable, "-c", OPEN, path.absolute().as_uri()],
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return process.wait(PATIENCE) == 0
    except subprocess.TimeoutExpired:
        threading.Thread(target=process.wait, daemon=True).start()  # to collect its exit status
        return True
    except OSError:
        return False
