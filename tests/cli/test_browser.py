"""Opening a page: only where there is a desktop or $BROWSER, and never longer than the command waits."""

import sys
import time
from pathlib import Path

import pytest

from pcsr.cli import browser
from pcsr.cli.browser import has_browser, open_page

NAMES = ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY", "SSH_CONNECTION", "SSH_TTY")


@pytest.fixture
def environment(monkeypatch):
    def set_to(**values):
        for name in NAMES:
            monkeypatch.delenv(name, raising=False)
        for name, value in values.items():
            monkeypatch.setenv(name, value)

    set_to()
    return set_to


@pytest.mark.parametrize(
    ("platform", "values", "there"),
    [
        ("linux", {}, False),
        ("linux", {"DISPLAY": ""}, False),
        ("linux", {"DISPLAY": ":0"}, True),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, True),
        ("linux", {"DISPLAY": ":0", "SSH_CONNECTION": "a 1 b 22"}, False),
        ("darwin", {}, True),
        ("darwin", {"SSH_TTY": "/dev/pts/0"}, False),
        ("win32", {}, True),
        ("linux", {"BROWSER": "firefox", "SSH_TTY": "/dev/pts/0"}, True),
    ],
)
def test_a_browser_is_there_on_a_desktop_or_where_it_is_named(environment, monkeypatch, platform, values, there):
    environment(**values)
    monkeypatch.setattr(sys, "platform", platform)
    assert has_browser() is there


def script(folder, text):
    path = folder / "browser.sh"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def test_the_page_is_given_to_the_browser(environment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    environment(BROWSER=script(tmp_path, f'echo "$1" > {tmp_path}/seen'))
    assert open_page(Path("a page.html"))
    assert (tmp_path / "seen").read_text().strip() == (tmp_path / "a page.html").as_uri()


def test_a_browser_that_fails_is_none(environment, tmp_path):
    environment(BROWSER=script(tmp_path, "exit 3"))
    assert not open_page(tmp_path / "page.html")


def test_a_browser_that_stays_open_holds_nothing_up(environment, tmp_path, monkeypatch):
    monkeypatch.setattr(browser, "PATIENCE", 1.0)
    environment(BROWSER=script(tmp_path, "exec sleep 7"))
    start = time.monotonic()
    assert open_page(tmp_path / "page.html")
    assert time.monotonic() - start < 5


def test_without_a_desktop_nothing_is_started(environment, tmp_path, monkeypatch):
    monkeypatch.setattr(browser.subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))
    assert not open_page(tmp_path / "page.html")
