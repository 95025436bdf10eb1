"""Panics of the library that unpacks LAZ."""

import os

import pytest

from pcsr import UserError
from pcsr.clouds.formats.laz import panics_as_errors


class PanicException(BaseException):
    pass


def unpack(said: bytes, error: type[BaseException] | None = None) -> None:
    with panics_as_errors():
        os.write(2, said)
        if error is not None:
            raise error


def test_a_panic_is_an_error_and_its_report_is_not_shown(capfd):
    with pytest.raises(UserError, match="compressed points are damaged"):
        unpack(b"thread panicked at ...", PanicException)
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


def test_what_others_say_comes_through(capfd):
    unpack(b"something else")
    assert capfd.readouterr().err == "something else"
    with pytest.raises(KeyError):
        unpack(b"and more", KeyError)
    assert capfd.readouterr().err == "and more"
