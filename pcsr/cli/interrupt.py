"""Handling of Ctrl-C while the modules of the command line are still being imported."""

import os
import sys
from types import TracebackType

MESSAGE = "interrupted; what is finished is kept, and no file is half written"
CODE = 130
"""Exit code of a command that Ctrl-C ended, by the convention of shells."""


def _excepthook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        os.write(2, f"{MESSAGE}\n".encode())
        os._exit(CODE)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _excepthook
