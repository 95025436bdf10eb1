"""Ctrl-C before the command line is there to catch it: while Python still imports what it is made of."""

import os
import sys
from types import TracebackType

MESSAGE = "interrupted; what is finished is kept, and no file is half written"
CODE = 130
"""What shells say of a command that Ctrl-C ended."""


def _excepthook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        os.write(2, f"{MESSAGE}\n".encode())
        os._exit(CODE)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _excepthook
