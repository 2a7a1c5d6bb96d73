"""The program: python -m brickfield."""

import signal
import sys

from . import _brickfield


def main() -> None:
    # The program answers signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_brickfield.main(["brickfield", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
