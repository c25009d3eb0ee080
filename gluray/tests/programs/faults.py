"""Calls each function that gluray intercepts, each in its own process, while a fault of gluray is injected there.

`faults.py LIST OUT`: LIST has names of functions, one per line, optionally with the number of the call that fails (`glVertex3f:40`). OUT gets for each of them, as JSON: colours of the frame
in which it is called, of the next frame, and the errors that OpenGL reports."""
import json, os, re, sys

NAMES = [line.strip() for line in open(sys.argv[1]) if line.strip()]
if "GLURAY_RUN_DIR" not in os.environ:
    # Nothing fails natively, so one process is enough.
    children = [("", NAMES)]
else:
    children = [(name, [name]) for name in NAMES]


def pieces():
    """The state that the table of calls below needs; imported in the child, because it opens a display."""
    import gl_by_ctypes as g

    c = g.c
    TYPES = {"b": c.c_int8, "s": c.c_int16, "i": c.c_int, "f": c.c_float, "d": c.c_double, "ub": c.c_uint8, "us": c.c_uint16, "ui": c.c_uint}
    # The value 1 in each type, for colours and normals.
    ONE = {"b": 127, "s": 32767, "i": 2**31 - 1, "f": 1, "d": 1, "ub": 255, "us": 65535, "ui": 2**32 - 1}
    u, i, f, d, p = c.c_uint, c.c_int, c.c_float, c.c_double, c.c_void_p
    keep = []

    def array(kind, *values):
        keep.append((kind * len(values))(*values))
        return c.cast(keep[-1], p)

    def call(name, types, *values):
        return g.F(name, *types)(*values)

    def vertices(middle=lambda: None, before=lambda: None, after=lambda: None):
        """Two triangles; `middle` comes before the second vertex of the second."""
        before()
        g.begin(g.TRIANGLES)
        for k, (x, y) in enumerate(((-1, -1), (0, -1), (-0.5, 0), (0, 0), (1, 0), (0.5, 1))):
            if k == 4:
                middle()
            g.normal(0.2 * k - 0.5, 0.3, 1)
            g.color(k / 6, 1 - k / 6, 0.4, 1)
            g.vertex(x, y, 0.1 * k)
        g.end()
        after()

    def family(name):
        m = re.fullmatch(r"gl(Vertex|Color|Normal|TexCoord)([1-4])(ub|us|ui|[bsifd])(v?)", name)
        if not m:
            return None
        what, n, kind, pointer = m[1], int(m[2]), m[3], m[4]
        t = TYPES[kind]
        one = ONE[kind] if what in ("Color", "Normal") else 1
        values = {"Vertex": (1, 0, 0, 1), "Normal": (0, 0, one)}.get(what, (one, 0, one, one))[:n]

        def run():
            call(name, (p,), array(t, *values)) if pointer else call(name, (t,) * n, *values)

        if what == "Vertex":
            # Instead of a vertex: a third triangle.
            def triangle():
                g.begin(g.TRIANGLES)
                g.vertex(-1, 0.2, 0)
                g.vertex(-0.2, 0.2, 0.1)
                run()
                g.end()

            return lambda: (vertices(), triangle())
        return lambda: vertices(run)

    def arrays():
        call("glVertexPointer", (i, u, i, p), 3, 0x1406, 0, array(f, -1, -1, 0, 1, -1, 0.3, 1, 1, 0, -1, 1, -0.3))
        call("glNormalPointer", (u, i, p), 0x1406, 0, array(f, *(0, 0.2, 1) * 4))
        g.enable_array(0x8074)
        g.enable_array(0x8075)

    indices = lambda: array(c.c_uint16, 0, 1, 2, 0, 2, 3)

    def elements(name, *more, base=()):
        arrays()
        kinds = (u,) + (u,) * len(more) + (i, u, p) + (i,) * len(base)
        call(name, kinds, 4, *more, 6, 0x1403, indices(), *base)

    def mapped(between=lambda: None):
        """A curved sheet through evaluators."""
        g.enable(0x0DB7)
        g.enable(0x0D80)
        points = [v for y in (-1, 1) for x in (-1, 0, 1) for v in (x, y, 0.3 * x * y)]
        call("glMap2f", (u, f, f, i, i, f, f, i, i, p), 0x0DB7, 0, 1, 3, 3, 0, 1, 9, 2, array(f, *points))
        call("glMapGrid2f", (i, f, f, i, f, f), 6, 0, 1, 6, 0, 1)
        between()
        call("glEvalMesh2", (u, i, i, i, i), 0x1B02, 0, 6, 0, 6)

    def in_strip(*calls):
        def run():
            mapped()
            g.begin(g.STRIP)
            for k in range(4):
                calls[k % len(calls)](k)
            g.end()

        return run

    def lists(name):
        new, end, play = g.F("glNewList", u, u), g.F("glEndList"), g.F("glCallList", u)

        def run():
            first = call("glGenLists", (i,), 3)
            for k in range(3):
                new(first + k, 0x1300)
                call("glTranslatef", (f, f, f), 0.05, 0, 0.1)
                vertices(after=lambda: call("glTranslatef", (f, f, f), 0.02, 0.1, 0))
                end()
            play(first)
            call("glCallLists", (i, u, p), 2, 0x1405, array(u, first + 1, first + 2))
            call("glDeleteLists", (u, i), first + 1, 1)
            play(first + 1)

        return run

    def buffer(suffix, sub=False, delete=False):
        def run():
            name = c.c_uint()
            call("glGenBuffers" + suffix, (i, p), 1, c.byref(name))
            call("glBindBuffer" + suffix, (u, u), 0x8892, name)
            data = array(f, -1, -1, 0, 1, -1, 0.3, 1, 1, 0, -1, 1, -0.3)
            call("glBufferData" + suffix, (u, c.c_ssize_t, p, u), 0x8892, 48, data, 0x88E4)
            call("glBufferSubData" + suffix, (u, c.c_ssize_t, c.c_ssize_t, p), 0x8892, 0, 12, array(f, -0.8, -0.8, 0.1))
            call("glVertexPointer", (i, u, i, p), 3, 0x1406, 0, None)
            g.enable_array(0x8074)
            g.normal(0, 0, 1)
            call("glDrawArrays", (u, i, i), g.QUADS, 0, 4)
            g.disable_array(0x8074)
            call("glBindBuffer" + suffix, (u, u), 0x8892, 0)
            call("glDeleteBuffers" + suffix, (i, p), 1, c.byref(name))

        return run

    def program():
        shaders = []
        for kind, text in ((0x8B31, b"void main() { gl_Position = ftransform(); }"), (0x8B30, b"void main() { gl_FragColor = vec4(0.2, 0.9, 0.3, 1.0); }")):
            s = call("glCreateShader", (u,), kind)
            call("glShaderSource", (u, i, p, p), s, 1, c.byref(c.c_char_p(text)), None)
            call("glCompileShader", (u,), s)
            shaders.append(s)
        name = call("glCreateProgram", ())
        for s in shaders:
            call("glAttachShader", (u, u), name, s)
        call("glLinkProgram", (u,), name)
        call("glUseProgram", (u,), name)
        vertices()
        call("glUseProgram", (u,), 0)

    def address(name):
        def run():
            get = getattr(g.GL if name.startswith("glX") else c.CDLL("libEGL.so.1"), name)
            get.restype = p
            found = get(b"glColor3f")
            assert found
            c.CFUNCTYPE(None, f, f, f)(found)(0, 1, 0)
            vertices()

        return run

    def contexts(make):
        def run():
            """Switches to another context, draws something in it, and switches back."""
            here = (run.window, run.context)
            other = make()
            g.current(run.window, other)
            g.start()
            g.bump(3)
            g.current(*here)
            call("glXDestroyContext", (p, p), g.dpy, other)
            vertices()

        return run

    def chosen():
        configs, n = g.GL.glXChooseFBConfig, c.c_int()
        configs.restype = c.POINTER(p)
        # The window's visual, so that contexts fit.
        for config in configs(g.dpy, 0, (i * 3)(0x800B, g.info.visualid & 0xFFFFFFFF, 0), c.byref(n))[: n.value]:
            return c.c_void_p(config)

    def new_context():
        make = g.GL.glXCreateNewContext
        make.restype = p
        return c.c_void_p(make(g.dpy, chosen(), 0x8014, None, 1))

    def attribs_context():
        make = g.GL.glXGetProcAddressARB
        make.restype = p
        create = c.CFUNCTYPE(p, p, p, p, i, p)(make(b"glXCreateContextAttribsARB"))
        return c.c_void_p(create(g.dpy, chosen(), None, 1, None))

    def current_by(name):
        def run():
            w, ctx = c.c_ulong(run.window), run.context
            if name == "glXMakeCurrent":
                assert g.GL.glXMakeCurrent(g.dpy, w, ctx)
            elif name == "glXMakeContextCurrent":
                assert g.GL.glXMakeContextCurrent(g.dpy, w, w, ctx)
            else:
                get = g.GL.glXGetProcAddressARB
                get.restype = p
                found = get(name.encode())
                if found:
                    c.CFUNCTYPE(i, p, c.c_ulong, c.c_ulong, p)(found)(g.dpy, w, w, ctx)
                else:
                    assert g.GL.glXMakeCurrent(g.dpy, w, ctx)
            vertices()

        return run

    one_by_one = {
        "glBegin": vertices,
        "glEnd": vertices,
        "glMaterialfv": lambda: vertices(lambda: call("glMaterialfv", (u, u, p), 0x0408, 0x1600, array(f, 1, 0, 0, 1))),
        "glMaterialiv": lambda: vertices(lambda: call("glMaterialiv", (u, u, p), 0x0408, 0x1600, array(i, 2**31 - 1, 0, 0, 2**31 - 1))),
        "glMaterialf": lambda: vertices(lambda: call("glMaterialf", (u, u, f), 0x0408, 0x1601, 60)),
        "glMateriali": lambda: vertices(lambda: call("glMateriali", (u, u, i), 0x0408, 0x1601, 60)),
        "glArrayElement": lambda: (arrays(), g.begin(g.QUADS), [call("glArrayElement", (i,), k) for k in range(4)], g.end()),
        "glArrayElementEXT": lambda: (arrays(), g.begin(g.QUADS), [call("glArrayElementEXT", (i,), k) for k in range(4)], g.end()),
        "glDrawArrays": lambda: (arrays(), call("glDrawArrays", (u, i, i), g.QUADS, 0, 4)),
        "glDrawArraysEXT": lambda: (arrays(), call("glDrawArraysEXT", (u, i, i), g.QUADS, 0, 4)),
        "glDrawElements": lambda: elements("glDrawElements"),
        "glDrawRangeElements": lambda: elements("glDrawRangeElements", 0, 3),
        "glDrawRangeElementsEXT": lambda: elements("glDrawRangeElementsEXT", 0, 3),
        "glDrawElementsBaseVertex": lambda: elements("glDrawElementsBaseVertex", base=(0,)),
        "glDrawRangeElementsBaseVertex": lambda: elements("glDrawRangeElementsBaseVertex", 0, 3, base=(0,)),
        **{"glDrawArraysInstanced" + s: lambda s=s: (arrays(), call("glDrawArraysInstanced" + s, (u, i, i, i), g.QUADS, 0, 4, 1)) for s in ("", "ARB", "EXT")},
        "glDrawArraysInstancedBaseInstance": lambda: (arrays(), call("glDrawArraysInstancedBaseInstance", (u, i, i, i, u), g.QUADS, 0, 4, 1, 0)),
        **{"glDrawElementsInstanced" + s: lambda s=s: elements("glDrawElementsInstanced" + s, base=(1,)) for s in ("", "ARB", "EXT")},
        "glDrawElementsInstancedBaseVertex": lambda: elements("glDrawElementsInstancedBaseVertex", base=(1, 0)),
        "glDrawElementsInstancedBaseInstance": lambda: elements("glDrawElementsInstancedBaseInstance", base=(1, 0)),
        "glDrawElementsInstancedBaseVertexBaseInstance": lambda: elements("glDrawElementsInstancedBaseVertexBaseInstance", base=(1, 0, 0)),
        **{"glMultiDrawArrays" + s: lambda s=s: (arrays(), call("glMultiDrawArrays" + s, (u, p, p, i), g.QUADS, array(i, 0), array(i, 4), 1)) for s in ("", "EXT")},
        **{"glMultiDrawElements" + s: lambda s=s: (arrays(), call("glMultiDrawElements" + s, (u, p, u, p, i), 4, array(i, 6), 0x1403, array(p, indices()), 1)) for s in ("", "EXT")},
        "glMultiDrawElementsBaseVertex": lambda: (
            arrays(),
            call("glMultiDrawElementsBaseVertex", (u, p, u, p, i, p), 4, array(i, 6), 0x1403, array(p, indices()), 1, array(i, 0)),
        ),
        "glMap2f": mapped,
        "glMapGrid2f": mapped,
        "glEvalMesh2": mapped,
        "glMap2d": lambda: mapped(
            lambda: call("glMap2d", (u, d, d, i, i, d, d, i, i, p), 0x0DB7, 0, 1, 3, 2, 0, 1, 6, 2, array(d, -1, -1, 0, 1, -1, 0, -1, 1, 0.2, 1, 1, 0))
        ),
        "glMapGrid2d": lambda: mapped(lambda: call("glMapGrid2d", (i, d, d, i, d, d), 6, 0, 1, 6, 0, 1)),
        "glMap1f": lambda: (vertices(), call("glMap1f", (u, f, f, i, i, p), 0x0D97, 0, 1, 3, 2, array(f, -1, 0, 0, 1, 0.5, 0))),
        "glMap1d": lambda: (vertices(), call("glMap1d", (u, d, d, i, i, p), 0x0D97, 0, 1, 3, 2, array(d, -1, 0, 0, 1, 0.5, 0))),
        "glMapGrid1f": lambda: (vertices(), call("glMapGrid1f", (i, f, f), 4, 0, 1)),
        "glMapGrid1d": lambda: (vertices(), call("glMapGrid1d", (i, d, d), 4, 0, 1)),
        "glEvalMesh1": lambda: (vertices(), call("glEvalMesh1", (u, i, i), 0x1B01, 0, 4)),
        "glEvalCoord1f": in_strip(lambda k: call("glEvalCoord1f", (f,), k / 3), lambda k: g.vertex(k / 3, 1, 0)),
        "glEvalCoord1d": in_strip(lambda k: call("glEvalCoord1d", (d,), k / 3), lambda k: g.vertex(k / 3, 1, 0)),
        "glEvalCoord1fv": in_strip(lambda k: call("glEvalCoord1fv", (p,), array(f, k / 3)), lambda k: g.vertex(k / 3, 1, 0)),
        "glEvalCoord1dv": in_strip(lambda k: call("glEvalCoord1dv", (p,), array(d, k / 3)), lambda k: g.vertex(k / 3, 1, 0)),
        "glEvalCoord2f": in_strip(lambda k: call("glEvalCoord2f", (f, f), k // 2, k % 2)),
        "glEvalCoord2d": in_strip(lambda k: call("glEvalCoord2d", (d, d), k // 2, k % 2)),
        "glEvalCoord2fv": in_strip(lambda k: call("glEvalCoord2fv", (p,), array(f, k // 2, k % 2))),
        "glEvalCoord2dv": in_strip(lambda k: call("glEvalCoord2dv", (p,), array(d, k // 2, k % 2))),
        "glEvalPoint1": in_strip(lambda k: call("glEvalPoint1", (i,), k), lambda k: g.vertex(k / 3, 1, 0)),
        "glEvalPoint2": in_strip(lambda k: call("glEvalPoint2", (i, i), 6 * (k // 2), 6 * (k % 2))),
        "glPrimitiveRestartNV": lambda: vertices(lambda: call("glPrimitiveRestartNV", ())),
        "glClear": lambda: (vertices(), g.clear(0x0100), vertices()),
        "glLinkProgram": program,
        "glGetError": lambda: (vertices(), call("glGetError", ()), vertices()),
        "glFlush": lambda: (vertices(), call("glFlush", ()), vertices()),
        "glFinish": lambda: (vertices(), call("glFinish", ()), vertices()),
        "glXCreateContext": contexts(g.context),
        "glXDestroyContext": contexts(g.context),
        "glXCreateNewContext": contexts(new_context),
        "glXCreateContextAttribsARB": contexts(attribs_context),
        # Calls of all kinds that gluray does not record: it only notices them, and looks values up.
        "glRotatef": lambda: (vertices(), g.rotate(20, 0, 0, 1), vertices()),
        "glTexImage2D": lambda: (vertices(), call("glTexImage2D", (u, i, i, i, i, i, u, u, p), 0x0DE1, 0, 0x1908, 2, 2, 0, 0x1908, 0x1401, None), vertices()),
        "glScissor": lambda: (vertices(), call("glScissor", (i, i, i, i), 0, 0, 64, 64), g.enable(0x0C11), vertices(), g.disable(0x0C11)),
        "glReadPixels": vertices,
    }
    for s, t in (("f", f), ("d", d), ("i", i), ("s", c.c_int16)):
        one_by_one["glRect" + s] = lambda s=s, t=t: (vertices(), call("glRect" + s, (t,) * 4, -1, -1, 1, 0))
    for name in ("glNewList", "glEndList", "glCallList", "glCallLists", "glDeleteLists", "glGenLists"):
        one_by_one[name] = lists(name)
    for suffix in ("", "ARB"):
        for name in ("glBufferData", "glBufferSubData", "glDeleteBuffers"):
            one_by_one[name + suffix] = buffer(suffix)
    for name in ("glXGetProcAddress", "glXGetProcAddressARB", "eglGetProcAddress"):
        one_by_one[name] = address(name)
    for name in ("glXMakeCurrent", "glXMakeContextCurrent", "glXMakeCurrentReadSGI"):
        one_by_one[name] = current_by(name)

    def egl():
        """An EGL context from creation to destruction, before there is one of GLX."""
        e = c.CDLL("libEGL.so.1")
        for name in ("eglGetPlatformDisplay", "eglCreateContext"):
            getattr(e, name).restype = p
        display = p(e.eglGetPlatformDisplay(0x31DD, None, None))
        assert e.eglInitialize(display, None, None)
        e.eglBindAPI(0x30A2)
        ctx = p(e.eglCreateContext(display, None, None, None))
        assert e.eglMakeCurrent(display, None, None, ctx)
        call("glGetError", ())
        assert e.eglMakeCurrent(display, None, None, None)
        assert e.eglDestroyContext(display, ctx)

    for name in ("eglCreateContext", "eglMakeCurrent", "eglDestroyContext"):
        one_by_one[name] = vertices
    return g, call, family, one_by_one, egl


def seen(names):
    g, call, family, one_by_one, egl = pieces()
    c = g.c

    def pixels():
        rgba = (c.c_uint8 * (g.W * g.H * 4))()
        call("glReadPixels", (c.c_int,) * 4 + (c.c_uint,) * 2 + (c.c_void_p,), 0, 0, g.W, g.H, 0x1908, 0x1401, rgba)
        return bytes(rgba).hex()

    def errors():
        return [e for e in (call("glGetError", ()) for _ in range(6)) if e]

    if any(n.startswith("egl") for n in names):
        egl()
    out = {}
    for spec in names:
        name = spec.split(":")[0]
        stage = family(name) or one_by_one[name]
        ctx = g.context()
        stage.__dict__.update(window=g.w0, context=ctx)
        g.current(g.w0, ctx)
        # A list and a colour from before the fault.
        g.start()
        g.lit()
        call("glNewList", (c.c_uint,) * 2, 900, 0x1300)
        g.bump(4)
        call("glEndList", ())
        g.color(0.9, 0.5, 0.2, 1)
        g.normal(0, 0.3, 1)
        g.begin(g.QUADS)
        for x, y in ((-1.4, -1.4), (1.4, -1.4), (1.4, -1.1), (-1.4, -1.1)):
            g.vertex(x, y, -0.5)
        g.end()
        stage()
        first, said = pixels(), errors()
        g.clear(0x4100)
        call("glPushMatrix", ())
        g.scale(0.7, 0.7, 0.7)
        call("glCallList", (c.c_uint,), 900)
        call("glPopMatrix", ())
        g.begin(g.TRIANGLES)
        for x, y in ((-1.4, -1.4), (1.4, -1.4), (0, -0.9)):
            g.vertex(x, y, 0.5)
        g.end()
        out[spec] = {"first": first, "next": pixels(), "errors": said + errors()}
        g.current(0, None)
    return out


out = {}
for fault, names in children:
    read, write = os.pipe()
    if os.fork() == 0:
        os.close(read)
        os.environ["GLURAY_INJECT_FAULT"] = fault
        try:
            text = json.dumps(seen(names))
        except BaseException as e:
            text = json.dumps({name: {"died": repr(e)} for name in names})
        with os.fdopen(write, "w") as pipe:
            pipe.write(text)
        # With its exit handlers.
        sys.exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        text = pipe.read()
    status = os.wait()[1]
    out.update(json.loads(text) if text and status == 0 else {n: {"died": f"status {status}"} for n in names})
with open(sys.argv[2], "w") as file:
    json.dump(out, file)
