"""Several threads with their own contexts, or without. `threads.py CASE OUT`; errors are printed on stderr."""
from gl_by_ctypes import *
from texture_scenes import *

read_pixels = F("glReadPixels", c_int, c_int, c_int, c_int, c_uint, c_uint, c_void_p)
finish = F("glFinish")


def seen():
    rgba = (c.c_uint8 * (W * H * 4))()
    read_pixels(0, 0, W, H, 0x1908, 0x1401, rgba)
    return bytes(rgba)


def on_thread(work):
    """Runs `work` on another thread to its end."""
    errors = []

    def guarded():
        try:
            work()
        except BaseException as e:
            errors.append(e)

    t = threading.Thread(target=guarded)
    t.start()
    t.join()
    for e in errors:
        raise e


def a_thread_without_a_context(w):
    """The thread's calls do nothing, regardless of what another thread has begun."""

    def calls():
        normal(0, 0, -1)
        color(1, 0, 0, 1)
        for i in range(200):
            vertex(i, 1, 1)
        end()
        begin(QUADS)

    start()
    lit()
    begin(TRIANGLES)
    normal(0, 0, 1)
    color(0, 1, 0, 1)
    vertex(-1, -1, 0)
    on_thread(calls)
    vertex(1, -1, 0)
    on_thread(calls)
    vertex(0, 1, 0)
    end()
    on_thread(calls)
    bump()


def triangles(shade, n):
    """Immediate mode, many short primitives: the thread of a vertex is determined for each."""
    start()
    lit()
    for i in range(n):
        begin(TRIANGLES)
        for k, (x, y) in enumerate(((-1, -1), (1, -1), (0, 1))):
            normal(0.1 * i, 0.1 * k, 1)
            color(shade, i / n, k / 3, 1)
            vertex(x * (1 - i / n), y * (1 - i / n), 0.5 * i / n)
        end()


def contexts_made_current_in_turns(w):
    """Four threads, each with a context that it makes current repeatedly; two more contexts move from thread to thread."""
    sys.setswitchinterval(1e-5)
    no_context(w)
    places = [(window(), context(), i) for i in range(6)]

    def picture(place):
        w, ctx, i = place
        current(w, ctx)
        triangles(i / 8, 12)
        out = seen()
        no_context(w)
        return out

    expected = {place[2]: picture(place) for place in places}
    wandering, lock, wrong = places[4:], threading.Lock(), []

    def work(own):
        for turn in range(25):
            if picture(own) != expected[own[2]]:
                wrong.append((own[2], turn))
            with lock:
                place = wandering.pop(0) if wandering else None
            if place:
                if picture(place) != expected[place[2]]:
                    wrong.append((place[2], turn))
                with lock:
                    wandering.append(place)

    threads = [threading.Thread(target=work, args=(p,)) for p in places[:4]]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    if wrong:
        print("wrong pictures:", wrong, file=sys.stderr)
    current(*places[0][:2])
    triangles(0, 12)


def no_context(w):
    assert GL.glXMakeCurrent(dpy, c_ulong(0), None)


def texture_of(seed):
    image(TEXTURE_2D, 0, RGBA, 64, 64, 0, RGBA, BYTES, texels(64, 64, seed))


def textured_square():
    textured(perspective=False)
    normal(0, 0, 1)
    bind_texture(TEXTURE_2D, 1)
    square(-1.2, -1.2, 1.2, 1.2)


class Other:
    """A thread with a context that shares its textures with `ctx` and executes given work."""

    def __init__(self, ctx):
        import queue

        self.jobs, self.done = queue.Queue(), queue.Queue()
        self.window, self.context = window(), context(ctx)
        self.thread = threading.Thread(target=self.work)
        self.thread.start()
        self.tell(lambda: current(self.window, self.context))

    def work(self):
        while (job := self.jobs.get()) is not None:
            try:
                job()
                self.done.put(None)
            except BaseException as e:
                self.done.put(e)
        no_context(self.window)

    def tell(self, job):
        self.jobs.put(job)
        e = self.done.get()
        if e:
            raise e

    def end(self):
        self.jobs.put(None)
        self.thread.join()


def sharing(w):
    no_context(w)
    ctx = context()
    current(w, ctx)
    return ctx


def textures_that_nobody_writes(w):
    """Two threads draw thirty frames, each with its own context and texture."""
    ctx = sharing(w)
    other = Other(ctx)
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, MIN, 0x2601)
    texture_of(1)
    finish()

    def frame():
        # Reading it back forces the draw, so that each frame looks up its texture again.
        textured_square()
        seen()

    for _ in range(30):
        frame()
        other.tell(frame)
    frame()
    other.end()


def a_texture_that_another_thread_writes(w):
    """Five times: written there, finished, bound and drawn here."""
    ctx = sharing(w)
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, MIN, 0x2601)
    texture_of(1)
    textured_square()
    finish()
    other = Other(ctx)

    def write(seed):
        bind_texture(TEXTURE_2D, 1)
        part(TEXTURE_2D, 0, 8, 8, 40, 40, RGBA, BYTES, texels(40, 40, seed))
        finish()

    pictures = []
    for seed in range(2, 7):
        textured_square()
        other.tell(lambda: write(seed))
        textured_square()
        pictures.append(seen())
    if len(set(pictures)) != 5:
        print("some writes were not seen", file=sys.stderr)
    other.end()


def a_texture_that_another_thread_draws_into(w):
    """A framebuffer object that stays bound there: only glFinish signals new content."""
    ctx = sharing(w)
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, MIN, 0x2601)
    texture_of(1)
    finish()
    other = Other(ctx)
    name = c_uint()

    def attach():
        F("glGenFramebuffers", c_int, c_void_p)(1, c.byref(name))
        F("glBindFramebuffer", c_uint, c_uint)(0x8D40, name)
        F("glFramebufferTexture2D", *[c_uint] * 4, c_int)(0x8D40, 0x8CE0, TEXTURE_2D, 1, 0)
        assert F("glCheckFramebufferStatus", c_uint)(0x8D40) == 0x8CD5
        finish()

    def fill(i):
        F("glClearColor", *[c_float] * 4)(i / 5, 1 - i / 5, 0.3, 1)
        clear(0x4000)
        finish()

    other.tell(attach)
    pictures = []
    for i in range(5):
        other.tell(lambda: fill(i))
        textured_square()
        pictures.append(seen())
    if len(set(pictures)) != 5:
        print("some pictures were not seen", file=sys.stderr)
    other.end()


def a_texture_that_is_written_while_it_is_drawn_with(w):
    """One thread writes while the other draws continuously; the last write must be visible at the end."""
    sys.setswitchinterval(1e-5)
    ctx = sharing(w)
    bind_texture(TEXTURE_2D, 1)
    parameter(TEXTURE_2D, MIN, 0x2601)
    texture_of(1)
    finish()
    other = Other(ctx)
    wrong = []
    pixels = {seed: texels(64, 64, seed) for seed in (3, 4)}
    expected = {}
    for seed in (3, 4):
        image(TEXTURE_2D, 0, RGBA, 64, 64, 0, RGBA, BYTES, pixels[seed])
        textured_square()
        expected[seed] = seen()

    def write(seed):
        bind_texture(TEXTURE_2D, 1)
        part(TEXTURE_2D, 0, 0, 0, 64, 64, RGBA, BYTES, pixels[seed])
        finish()

    for turn in range(60):
        seed = 3 + turn % 2
        other.jobs.put(lambda: write(seed))
        while other.done.empty():
            textured_square()
            finish()
        e = other.done.get()
        if e:
            raise e
        textured_square()
        if seen() != expected[seed]:
            wrong.append(turn)
    if wrong:
        print("stale texels in turns", wrong, file=sys.stderr)
    other.end()


CASES = (
    a_thread_without_a_context,
    contexts_made_current_in_turns,
    textures_that_nobody_writes,
    a_texture_that_another_thread_writes,
    a_texture_that_another_thread_draws_into,
    a_texture_that_is_written_while_it_is_drawn_with,
)
run({case.__name__: case for case in CASES})
