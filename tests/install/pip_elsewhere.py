"""pip, as if it ran on another machine: `pip_elsewhere.py ENVIRONMENT ARGUMENTS…`.

`pip install --platform` chooses wheels of another platform, but asks this machine which requirements apply. ENVIRONMENT
is JSON of what to answer instead, by the names of environment markers.
"""

import json
import sys

from pip._internal.cli.main import main
from pip._vendor.packaging import markers

if __name__ == "__main__":
    here, elsewhere = markers.default_environment(), json.loads(sys.argv[1])
    assert elsewhere.keys() <= here.keys()
    markers.default_environment = lambda: here | elsewhere
    sys.exit(main(sys.argv[2:]))
