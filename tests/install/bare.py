"""A process in which only the core's packages can be found. It runs what its input says, and prints the results.

Input, as JSON: `absent`, top-level modules that are not to be found, and `commands`, lists of arguments of `pcsr`, or
Python to execute in a list of its own: `["-c", "…"]`. Output: for each its code, what it printed, and which absent
modules files of pcsr asked for.
"""

import contextlib
import io
import json
import sys
import traceback
from importlib.machinery import PathFinder
from pathlib import Path

ASKED: list[str] = []
ABSENT: set[str] = set()


class Bare(PathFinder):
    """Python's own finder, which does not find what is absent."""

    @classmethod
    def find_spec(cls, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in ABSENT:
            return super().find_spec(name, path, target)
        frame = sys._getframe(1)
        while frame and ("importlib" in frame.f_code.co_filename):
            frame = frame.f_back
        if frame and {"pcsr", "pcsr_plugins"} & set(Path(frame.f_code.co_filename).parts[:-1]):
            ASKED.append(top)
        return None


def run(arguments):
    ASKED.clear()
    out, err, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            if arguments[0] == "-c":
                exec(arguments[1], {})
            else:
                from pcsr.cli import main

                main(arguments)
        except SystemExit as left:
            code = left.code or 0
        except BaseException:
            traceback.print_exc(file=err)
            code = 1
    return {"code": code, "out": out.getvalue(), "err": err.getvalue(), "asked": sorted(set(ASKED))}


if __name__ == "__main__":
    given = json.load(sys.stdin)
    ABSENT.update(given["absent"])
    sys.meta_path[:] = [Bare if finder is PathFinder else finder for finder in sys.meta_path]
    json.dump([run(arguments) for arguments in given["commands"]], sys.stdout)
