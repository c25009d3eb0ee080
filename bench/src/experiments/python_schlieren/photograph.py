"""Makes a photograph of a flow in a numpy file, and prints how long its parts take.

One argument, a JSON object: {"flow": npy file, "spacing": m, "size": pixels, "tolerance": rad,
"image": PNG file, "map": npy file}.
"""

import json
import sys
import time

start = time.perf_counter()

import numpy as np  # noqa: E402
import schlieren  # noqa: E402

order = json.loads(sys.argv[1])
loaded = time.perf_counter()
density = np.load(order["flow"])
field = schlieren.Field(density=density, spacing=order["spacing"])
read = time.perf_counter()
size = (order["size"], order["size"])
image = schlieren.render(field, "schlieren", size=size, tolerance_rad=order["tolerance"])
rendered = time.perf_counter()
image.save(order["image"])
np.save(order["map"], image.deflection_rad)
seconds = {"import": loaded - start, "read": read - loaded, "render": rendered - read}
print(json.dumps({"seconds": seconds, "version": schlieren.__version__}))
