"""The comparison of docs/peers.md: one solver, one scene, a line of numbers.

python docs/peers.py {ours|newton|mujoco} {drape|curtain} [--n 79] [--frames 120] [--substeps 1] [--iterations 3]
                     [--stiffer 1.0]

newton and mujoco each want an environment of their own (pip install newton, pip install mujoco); ours that of this
project. stiffer: factor of our springs along the threads, for a stretch as small as another's. Times are processor
time a frame, which other work on the machine disturbs least.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

DENSITY, STIFFNESS, GRAVITY, RADIUS, HEIGHT, FRICTION, RATE, GAP = 0.15, 1000.0, 9.81, 0.25, 0.26, 0.3, 60, 0.005
Solver = tuple[Callable[[], object], Callable[[], np.ndarray]]


def ours(scene: str, n: int, args: argparse.Namespace) -> Solver:
    from taichi_cloth.ground import runtime
    from taichi_cloth.motion.forces import Forces, Sphere
    from taichi_cloth.motion.simulation import Simulation
    from taichi_cloth.sheet.materials import Material
    from taichi_cloth.sheet.pins import Pins
    from taichi_cloth.sheet.sheet import Sheet
    from taichi_cloth.sheet.springs import calibrate
    from taichi_cloth.solvers.verlet import Verlet

    runtime.start("cpu", threads=1)
    material = Material(
        tensile_warp=args.stiffer * STIFFNESS,
        tensile_weft=args.stiffer * STIFFNESS,
        shear=0.1 * STIFFNESS,
        bending_warp=1e-5,
        bending_weft=1e-5,
        density=DENSITY,
        air_damping=1.0,
    )
    held = np.zeros((n, n), bool)
    held[-1] = scene == "curtain"
    springs = calibrate(material, spacing_x=1 / (n - 1), spacing_y=1 / (n - 1))
    sheet = Sheet.rectangle(n, n, material=material, springs=springs, pinned=held)
    x = sheet.flat() - [0.5, 0.5, 0.0]
    x = np.stack([x[..., 0], 0 * x[..., 0] + HEIGHT, -x[..., 1]], -1) if scene == "drape" else x - [0.0, 0.5, 0.0]
    ball = Sphere(centre=(0.0, 0.0, 0.0), radius=RADIUS, gap=GAP, friction=FRICTION) if scene == "drape" else None
    forces = Forces(gravity=(0.0, -GRAVITY, 0.0), sphere=ball)
    solver = Verlet(sheet, forces, frame_rate=RATE)
    pins = (Pins(held),) if held.any() else ()
    simulation = Simulation(sheet, solver, forces=forces, positions=x, pins=pins)
    return simulation.step, lambda: simulation.positions


def newton(scene: str, n: int, args: argparse.Namespace) -> Solver:
    import newton
    import warp as wp
    from newton.solvers import SolverStyle3D, style3d

    wp.set_device("cpu")
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
    SolverStyle3D.register_custom_attributes(builder)
    upright = wp.quat_from_axis_angle(wp.vec3(1.0, 0.0, 0.0), wp.pi * 0.5)
    style3d.add_cloth_grid(
        builder,
        pos=wp.vec3(-0.5, -0.5, HEIGHT) if scene == "drape" else wp.vec3(-0.5, 0.0, -1.0),
        rot=wp.quat_identity() if scene == "drape" else upright,
        vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=n - 1,
        dim_y=n - 1,
        cell_x=1 / (n - 1),
        cell_y=1 / (n - 1),
        mass=DENSITY / n**2,
        particle_radius=GAP,
        fix_top=scene == "curtain",
        tri_aniso_ke=wp.vec3(STIFFNESS, STIFFNESS, 0.1 * STIFFNESS),
        edge_aniso_ke=wp.vec3(1e-4, 1e-4, 1e-4),
    )
    if scene == "drape":
        shape = builder.default_shape_cfg.copy()
        shape.mu = FRICTION
        builder.add_shape_sphere(body=-1, radius=RADIUS, cfg=shape)
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = 1e3, 1e-4, FRICTION
    config = SolverStyle3D.Config(iterations=args.iterations, linear_iterations=10)
    solver, control = SolverStyle3D(model, config=config), model.control()
    states = [model.state(), model.state()]
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()

    def step() -> None:
        pipeline.collide(states[0], contacts)
        for _ in range(args.substeps):
            states[0].clear_forces()
            solver.step(states[0], states[1], control, contacts, 1 / RATE / args.substeps)
            states.reverse()

    return step, lambda: states[0].particle_q.numpy().reshape(n, n, 3)


def mujoco(scene: str, n: int, args: argparse.Namespace) -> Solver:
    import mujoco

    pins = f'<pin id="{" ".join(str(i * n + n - 1) for i in range(n))}"/>' if scene == "curtain" else ""
    ball = f'<geom type="sphere" size="{RADIUS}" friction="{FRICTION} 0.005 0.0001"/>' if scene == "drape" else ""
    at = f'pos="0 0 {HEIGHT}"' if scene == "drape" else 'pos="0 0 -0.5" quat="0.70710678 0.70710678 0 0"'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{1 / RATE / args.substeps}" gravity="0 0 -{GRAVITY}"
        iterations="{args.iterations}" solver="CG" integrator="discrete" jacobian="sparse" tolerance="1e-6"/>
        <size memory="4G"/><worldbody>{ball}
        <body name="p" {at}><flexcomp type="grid" count="{n} {n} 1" spacing="{1 / (n - 1)} {1 / (n - 1)} 0.01"
        mass="{DENSITY}" radius="{GAP}" name="cloth" dim="2"><contact selfcollide="none" condim="3"
        friction="{FRICTION} 0.005 0.0001"/><elasticity young="{STIFFNESS / 0.0005}" poisson="0" thickness="0.0005"
        elastic2d="stretch" damping="1e-4"/>{pins}</flexcomp></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    def step() -> None:
        for _ in range(args.substeps):
            mujoco.mj_step(model, data)

    return step, lambda: data.flexvert_xpos.copy().reshape(n, n, 3)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("solver", choices=("ours", "newton", "mujoco"))
    parser.add_argument("scene", choices=("drape", "curtain"))
    for name, default in (("n", 79), ("frames", 120), ("substeps", 1), ("iterations", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--stiffer", type=float, default=1.0)
    args = parser.parse_args()
    step, positions = {"ours": ours, "newton": newton, "mujoco": mujoco}[args.solver](args.scene, args.n, args)
    times, lowest, stretch = [], [], []
    up = 1 if args.solver == "ours" else 2
    for _ in range(args.frames):
        begin = time.process_time()
        step()
        times.append(1e3 * (time.process_time() - begin))
        x = positions().astype(float)
        lowest.append(float(x[..., up].min()))
        longest = max(float(np.linalg.norm(np.diff(x, axis=k), axis=-1).max()) for k in (0, 1))
        stretch.append(longest * (args.n - 1) - 1)
    middle, least = statistics.median(times[2:]), min(times[2:])
    print(f"{args.solver} {args.scene} {args.n}: {middle:.1f} ms of processor time a frame, the fastest {least:.1f}")
    print(f"largest stretch {100 * stretch[-1]:.2f} %, on the way {100 * max(stretch):.2f} %; ", end="")
    print(f"lowest point {lowest[min(15, len(lowest) - 1)]:+.3f} m at frame 16, {lowest[-1]:+.3f} m at the end")
    if args.scene == "curtain":
        print(f"bottom {1e3 * (-1 - statistics.mean(lowest[len(lowest) // 2 :])):.3f} mm lower (closed form: 0.736)")


if __name__ == "__main__":
    main()
