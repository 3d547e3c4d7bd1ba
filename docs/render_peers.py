"""One picture by several renderers in turn: 377,508 half-transparent particles of a woven tube, 1280 x 720 px.

python docs/render_peers.py [--frames 12] [--particles 377508] [--renderers ours,moderngl,vtk]

Ours and moderngl (pip install moderngl; OpenGL by Mesa's llvmpipe without a display) do the same work: project, shade,
sort by depth, blend in linear light, one 8-bit sRGB picture in memory. VTK (pip install vtk) blends Gaussian points
that its own filter sorts, in its own way. What is not installed is left out. Medians over views of a camera that turns.
"""

import os
import statistics
import time
from argparse import ArgumentParser
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection

import numpy as np

os.environ.setdefault("LP_NUM_THREADS", "2")
os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.particles import Particles

WIDTH, HEIGHT, OPACITY = 1280, 720, 0.85
Draw = Callable[[Camera], object]


def woven_tube(count: int) -> Particles:
    """A plain-woven tube 0.6 m high, 0.3 m wide, of plied yarns: particles in the order of the yarns."""
    across, high, each = 0.94, 0.6, 12
    pitch = (2 * across * high * each / count) ** 0.5
    rng = np.random.default_rng(7)
    along, yarn = np.divmod(np.arange(count // 2), round(across / pitch))
    around = [(yarn + 0.5) * pitch, along * pitch * 2 / each]
    places = []
    for u, s, up in ((around[0], around[1], 1), (around[1], around[0], -1)):
        wave = 0.3 * pitch * up * np.cos(np.pi * (u + s) / pitch)
        angle, out = 2 * np.pi * u / across, 0.15 + wave
        places.append(np.stack([out * np.sin(angle), s % high, out * np.cos(angle)], 1))
    place = np.concatenate(places) + rng.normal(0, 0.06 * pitch, (2 * (count // 2), 3))
    normal = place * (1, 0, 1) / np.linalg.norm(place * (1, 0, 1), axis=1, keepdims=True)
    colour = rng.uniform(0.1, 0.7, (len(place), 3))
    return Particles(place, 0.0027, colour, np.tile([[0.0, 1.0, 0.0]], (len(place), 1)), normal, opacity=OPACITY)


def ours(p: Particles) -> Draw:
    from taichi_cloth.ground import runtime
    from taichi_cloth.render.data.sprites import SOFT
    from taichi_cloth.render.splat.splat import Splatter

    runtime.start(threads=2, pin=True)
    splatter, out = Splatter(WIDTH, HEIGHT, profile=SOFT).load(p), np.empty((HEIGHT, WIDTH, 3), np.uint8)
    return lambda camera: splatter.render(camera, out=out)


VERTEX = """#version 330
in vec3 p; in float r; in vec3 c; in vec3 n; uniform mat3 R; uniform vec3 t; uniform vec4 K; uniform vec3 L;
out vec3 colour; flat out vec3 disc;
void main() {
    vec3 q = R * p + t; vec2 s = K.x * q.xy / q.z + K.yz; disc = vec3(s, K.x * r / q.z);
    colour = c * (0.3 + 0.7 * max(0.0, dot(n, L)));
    gl_Position = vec4(2.0 * s.x / 1280.0 - 1.0, 1.0 - 2.0 * s.y / 720.0, 0.5, 1.0); gl_PointSize = 2.0 * disc.z + 1.0;
}"""
FRAGMENT = """#version 330
in vec3 colour; flat in vec3 disc; uniform float a; out vec4 o;
void main() {
    vec2 d = vec2(gl_FragCoord.x, 720.0 - gl_FragCoord.y) - disc.xy; float q = 1.0 - dot(d, d) / (disc.z * disc.z);
    if (q <= 0.0) discard;
    o = vec4(colour, 1.0) * (a * q * q);
}"""
SRGB = """#version 330
uniform sampler2D s; out vec4 o;
void main() {
    vec4 c = texelFetch(s, ivec2(gl_FragCoord.xy), 0); vec3 l = c.rgb + (1.0 - c.a) * vec3(0.8, 0.82, 0.85);
    o = vec4(mix(12.92 * l, 1.055 * pow(l, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, l)), 1.0);
}"""


def moderngl(p: Particles) -> Draw:
    """Point sprites, sorted from the farthest by NumPy, blended into 16-bit floats."""
    import moderngl as gl

    context = gl.create_standalone_context(backend="egl", require=330)
    splat = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    whole = "#version 330\nin vec2 p; void main() { gl_Position = vec4(p, 0.0, 1.0); }"
    shown = context.program(vertex_shader=whole, fragment_shader=SRGB)
    linear, bytes_ = context.texture((WIDTH, HEIGHT), 4, dtype="f2"), context.texture((WIDTH, HEIGHT), 4)
    blended, last = context.framebuffer([linear]), context.framebuffer([bytes_])
    radius = np.broadcast_to(p.radius, len(p))[:, None]
    data = context.buffer(np.concatenate([p.position, radius, p.colour, p.normal], 1).astype("f4").tobytes())
    order = context.buffer(reserve=4 * len(p))
    points = context.vertex_array(splat, [(data, "3f 1f 3f 3f", "p", "r", "c", "n")], order)
    corners = np.array([-1, -1, 3, -1, -1, 3], "f4")
    screen = context.vertex_array(shown, [(context.buffer(corners.tobytes()), "2f", "p")])
    context.enable(gl.PROGRAM_POINT_SIZE)
    context.blend_func = gl.ONE, gl.ONE_MINUS_SRC_ALPHA
    splat["L"], splat["a"] = (0.48, 0.75, 0.45), OPACITY

    def draw(camera: Camera) -> np.ndarray:
        rotation = camera.rotation.astype("f4")
        depth = p.position @ rotation[2] + np.float32(camera.translation[2])
        order.write(np.argsort(-depth).astype("i4").tobytes())
        splat["R"].write(np.ascontiguousarray(rotation.T).tobytes())
        splat["t"], splat["K"] = tuple(camera.translation), (camera.focal, camera.cx, camera.cy, 0.0)
        blended.use()
        blended.clear(0, 0, 0, 0)
        context.enable(gl.BLEND)
        points.render(gl.POINTS)
        last.use()
        context.disable(gl.BLEND)
        linear.use(0)
        screen.render()
        return np.frombuffer(last.read(components=3), np.uint8).reshape(HEIGHT, WIDTH, 3)[::-1]

    return draw


def vtk(p: Particles) -> Draw:
    """Gaussian points, sorted by VTK's own filter."""
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersHybrid import vtkDepthSortPolyData
    from vtkmodules.vtkRenderingCore import (
        vtkActor,
        vtkPointGaussianMapper,
        vtkRenderer,
        vtkRenderWindow,
        vtkWindowToImageFilter,
    )

    cloud, places, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(p.position.astype("f4"), deep=True))
    index = numpy_to_vtk(np.arange(len(p)), deep=True, array_type=12)
    cells.SetData(numpy_to_vtk(np.arange(len(p) + 1), deep=True, array_type=12), index)
    cloud.SetPoints(places)
    cloud.SetVerts(cells)
    rgba = np.concatenate([255 * p.colour, np.full((len(p), 1), 255 * OPACITY)], 1).astype(np.uint8)
    colour = numpy_to_vtk(rgba, deep=True)
    colour.SetName("colour")
    cloud.GetPointData().SetScalars(colour)
    mapper, actor, renderer, window = vtkPointGaussianMapper(), vtkActor(), vtkRenderer(), vtkRenderWindow()
    sort = vtkDepthSortPolyData()
    sort.SetInputData(cloud)
    sort.SetCamera(renderer.GetActiveCamera())
    sort.SetDirectionToBackToFront()
    mapper.SetInputConnection(sort.GetOutputPort())
    mapper.SetScaleFactor(float(np.mean(p.radius)))
    actor.SetMapper(mapper)
    actor.ForceTranslucentOn()
    renderer.AddActor(actor)
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(WIDTH, HEIGHT)
    window.AddRenderer(renderer)

    def draw(camera: Camera) -> np.ndarray:
        view = renderer.GetActiveCamera()
        view.SetPosition(*camera.eye)
        view.SetFocalPoint(*(camera.eye + camera.forward))
        view.SetViewUp(*(-camera.rotation[1]))
        view.SetViewAngle(float(np.degrees(2 * np.arctan(HEIGHT / 2 / camera.focal))))
        renderer.ResetCameraClippingRange()
        window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.ReadFrontBufferOff()
        grab.Update()
        return vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())

    return draw


def work(name: str, frames: int, particles: int, wire: Connection) -> None:
    """One renderer in a process of its own, as each brings its own LLVM: a view is asked for, what it took is sent."""
    angles = 2 * np.pi * np.arange(frames + 2) / 36
    eyes = [(1.25 * np.sin(a), 0.4, 1.25 * np.cos(a)) for a in angles]
    cameras = [look_at(eye, (0, 0.3, 0), width=WIDTH, height=HEIGHT, fov=35) for eye in eyes]
    try:
        draw = {"ours": ours, "moderngl": moderngl, "vtk": vtk}[name](woven_tube(particles))
    except ImportError as error:
        wire.send(str(error))
        return
    wire.send(None)
    for camera in cameras:
        wire.recv()
        begin = time.perf_counter()
        draw(camera)
        wire.send(1e3 * (time.perf_counter() - begin))


def main() -> None:
    parser = ArgumentParser()
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--particles", type=int, default=377_508)
    parser.add_argument("--renderers", default="ours,moderngl,vtk")
    args = parser.parse_args()
    wires: dict[str, Connection] = {}
    context = get_context("spawn")
    for name in args.renderers.split(","):
        wire, other = context.Pipe()
        context.Process(target=work, args=(name, args.frames, args.particles, other), daemon=True).start()
        missing = wire.recv()
        if missing is None:
            wires[name] = wire
        else:
            print(f"{name}: left out, {missing}")
    took: dict[str, list[float]] = {name: [] for name in wires}
    for _ in range(args.frames + 2):
        for name, wire in wires.items():
            wire.send(None)
            took[name].append(wire.recv())
    print(f"{args.particles:,} particles, {WIDTH} x {HEIGHT} px, {args.frames} views, load {os.getloadavg()[0]:.1f}")
    for name, ms in took.items():
        ratio = statistics.median(a / b for a, b in zip(ms[2:], took["ours"][2:], strict=True))
        print(f"{name:10} {statistics.median(ms[2:]):8.1f} ms, least {min(ms[2:]):.1f}; {ratio:.1f} times ours")


if __name__ == "__main__":
    main()
