"""What both packages' tests share lies beside the Rust code that they share."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent / "work" / "testing"))
