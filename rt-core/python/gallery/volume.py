"""An orbital of the hydrogen atom as a volume: where its electron is likely to be.

Shows: `rt_core.Volume` with colours and opacities of its own, seen in parallel so that the picture
has axes.
"""

import sys

import numpy as np
import rt_core
from matplotlib import cm, colors, pyplot

pyplot.switch_backend("Agg")

# The wave function 4f, m = 0, in units of Bohr's radius a0 = 0.0529 nm, on a lattice.
nodes, reach = 121, 32.0
s = np.linspace(-reach, reach, nodes)
x, y, z = np.meshgrid(s, s, s, indexing="ij")
r = np.sqrt(x**2 + y**2 + z**2)
cosine = np.divide(z, r, out=np.zeros_like(z), where=r > 0)
radial = r**3 * np.exp(-r / 4) / (768 * np.sqrt(35))
angular = np.sqrt(7 / (16 * np.pi)) * (5 * cosine**3 - 3 * cosine)
probability = (radial * angular) ** 2

# It is somewhere: what the lattice leaves out is beyond its border.
step = s[1] - s[0]
total = probability.sum() * step**3
print(f"{nodes}^3 nodes; {100 * total:.1f} % of the probability is within {reach:.0f} a0")
assert 0.95 < total < 1

# Light of each shell by the logarithm of the density, from 3 decades below the largest on.
largest = np.log10(probability.max())
level = np.log10(np.maximum(probability, 10 ** (largest - 6)))
shells = [[largest - 6, 0], [largest - 2.6, 0], [largest - 1.8, 0.06], [largest - 0.9, 0.1],
          [largest - 0.4, 0.5], [largest, 0.95]]  # fmt: skip
span = (largest - 2.6, largest)
inferno = cm.inferno(np.linspace(0.15, 0.95, 32))[:, :3]
linear = np.where(inferno <= 0.04045, inferno / 12.92, ((inferno + 0.055) / 1.055) ** 2.4)
cloud = rt_core.Volume(
    level,
    shells,
    unit_distance=4.0,
    spacing=step,
    origin=(-reach,) * 3,
    color_map=linear,
    range=span,
)
camera = rt_core.Camera((0, -100, 0), (0, 0, 0), height=2 * reach)
picture = rt_core.render(cloud, camera=camera, size=(640, 640), samples=4, ambient=1.0)
# Along z there are lobes above and below, and the plane between them is empty.
cover = picture.color[..., 3]
assert cover[100:300, 320].max() > 0.5 and cover[318:322].max() < 0.1
np.testing.assert_allclose(cover, cover[::-1], atol=0.1)

figure, ax = pyplot.subplots(figsize=(6.6, 5.6), layout="constrained")
ax.set_facecolor("black")
ax.imshow(picture.rgba8, extent=(-reach, reach, -reach, reach))
ax.set(xlabel="x in a0", ylabel="z in a0", title="hydrogen, 4f with m = 0")
scale = cm.ScalarMappable(colors.Normalize(*span), colors.ListedColormap(inferno))
figure.colorbar(scale, ax=ax, label="log10 of the probability per a0³")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "volume.png", dpi=80)
