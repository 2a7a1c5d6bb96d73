"""The program: python -m brickfield.

Run as a file, it does without the package and NumPy, which take a fifth of a second to load.
"""

import signal
import sys

try:
    from . import _brickfield
except ImportError:
    import _brickfield  # type: ignore[import-not-found, no-redef]


def main() -> None:
    # The program answers signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_brickfield.main(["brickfield", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
