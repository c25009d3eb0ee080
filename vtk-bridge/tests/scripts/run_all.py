"""Runs scripts one after the other in one process: python run_all.py FOLDER SCRIPT... Prints which one is running, so that a
crash can be attributed; a script that raises does not stop the others."""
import os
import runpy
import sys
import time
import traceback

here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, here)
folder, scripts = sys.argv[1], sys.argv[2:]
failed = 0
for script in scripts:
    name = os.path.splitext(os.path.basename(script))[0]
    target = os.path.join(folder, name)
    os.makedirs(target, exist_ok=True)
    sys.argv = [script, target]
    print("running", name, flush=True)
    start = time.time()
    try:
        runpy.run_path(script, run_name="__main__")
    except Exception:
        traceback.print_exc()
        print("raised", name, flush=True)
        failed = 1
    if "paraview.simple" in sys.modules:
        # Views that outlive their script would be drawn again by the next one, and would be
        # destroyed in the wrong order at exit.
        simple = sys.modules["paraview.simple"]
        for view in simple.GetRenderViews():
            simple.Delete(view)
    print("finished", name, round(time.time() - start, 2), flush=True)
sys.stdout.flush()
sys.exit(failed)
