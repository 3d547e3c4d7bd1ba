"""Cloth modelled from its fibres up: fibres, yarns, weaves, and what every fibre looks like.

The rooms follow Zhu, Li & Ma 2016, "Fiber-Based 3D Cloth Modeling and Garment Simulation with
Photorealistic Appearance": `fibre` (2.1), `yarn`, `spin` and `twist` (2.2), `weave`, `wif`, `crimp` and
`fabric` (2.3), `springs`, `sheet` and `simulation` (3.1), `solvers` (3.2), `blocks` (3.3). `taichi_cloth.render` draws,
`taichi_cloth.scenes` says what a scene is and holds the command line. Importing starts nothing:
`taichi_cloth.runtime.start` does.
"""

import os

# Taichi prints a banner when it is imported and asks a server for its newest version: neither is wanted
# in a log. Both switches are read at import, so they are set before any module of ours imports taichi.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")

__version__ = "0.1.0"

__all__ = ["__version__"]
