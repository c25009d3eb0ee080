"""Draws every scene with our device and with barney: `compare.py FOLDER [SCENE...]`. Prints a JSON object by scene; images are written to FOLDER.

The comparison uses uniform light from all directions with all bounces, which shows shapes, colours, textures and opacities. Other light is compared
with closed forms (spec.py), because barney's matte material is not Lambertian: measured on a white sphere with version 1.2.6, a directional light gives
0.65 of albedo / pi * irradiance * cos where the surface faces it and 0.32 at 64 degrees, and uniform light gives 0.826 of the albedo at all angles.
"""
import json
import subprocess
import sys

import scenes
from anari_c import *

SAMPLES = 64
AMBIENT = 0.8
# Corrects barney's albedo, see above.
BARNEY_FACTOR = 1 / 0.826
# Scenes that barney 1.2.6 supports with the same semantics. It has no curves (the process ends), no
# isosurfaces, and of the samplers only some images (others are black or misplaced); its volumes are
# noise. Those scenes are compared with closed forms in spec.py.
COMPARED = ["triangle", "triangle_colors", "triangle_soup", "quad", "sphere", "sphere_common", "cylinder", "cylinder_open", "cone", "instances"]


def picture(device, scene):
    d = Device(device)
    ours = device == "rtv"
    ambient = AMBIENT * (1.0 if ours else BARNEY_FACTOR)
    f = scenes.view(d, scene(d), lights=[], ambient=ambient, renderer="pathtracer" if ours and scene is not scenes.volume else "default", pixelSamples=SAMPLES)
    return draw(d, f), d


def save(path, p):
    try:
        from PIL import Image
    except ImportError:
        return
    Image.fromarray(np.ascontiguousarray(p[::-1, :, :3])).save(path)


def barney(folder, name):
    """Runs barney in its own process, which it may crash."""
    path = f"{folder}/{name}_barney.npy"
    run = subprocess.run([sys.executable, __file__, "--barney", path, name], capture_output=True)
    return np.load(path) if run.returncode == 0 else None


if __name__ == "__main__":
    by_name = {s.__name__: s for s in scenes.SCENES}
    if sys.argv[1] == "--barney":
        np.save(sys.argv[2], picture("barney", by_name[sys.argv[3]])[0])
        sys.exit()
    folder, chosen = sys.argv[1], sys.argv[2:] or list(by_name)
    out = {}
    for name in chosen:
        ours, d = picture("rtv", by_name[name])
        save(f"{folder}/{name}_rtv.png", ours)
        found = dict(messages=[t for s, t in d.messages if s in ("fatal", "error", "warning")], covered=int((np.abs(ours.astype(int) - ours[0, 0]).sum(-1) > 8).sum()))
        found["comparable"] = name in COMPARED
        theirs = barney(folder, name) if found["comparable"] or chosen == sys.argv[2:] else None
        if theirs is not None:
            save(f"{folder}/{name}_barney.png", theirs)
            found["psnr"] = round(float(psnr(ours[..., :3], theirs[..., :3])), 2)
        out[name] = found
        print(name, found, file=sys.stderr, flush=True)
    print(json.dumps(out))
