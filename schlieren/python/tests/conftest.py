"""What both packages' tests share lies beside the Rust code that they share."""

import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent.parent
sys.path.append(str(ROOT / "rt-core" / "python" / "work" / "testing"))
