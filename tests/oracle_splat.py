"""The splatter's picture in plain NumPy, particle by particle and in float64: slow, short, and no tiles."""

import numpy as np
from scipy.ndimage import map_coordinates

from taichi_cloth.render.data.camera import Camera
from taichi_cloth.render.data.finish import Finish
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.data.sprites import Profile, SpriteSheet


def shade(p: Particles, camera: Camera, light: Lighting, finish: Finish) -> np.ndarray:
    """Radiance (n, 3): Kajiya-Kay and Lambert mixed, a sheen, and fill from a hemisphere."""
    to_light = light.towards_key(camera)
    key, sky, ground = light.radiances()
    view = camera.eye - p.position
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    tl, tv = p.tangent @ to_light, (p.tangent * view).sum(1)
    nl, nv = p.normal @ to_light, (p.normal * view).sum(1)
    sl, sv = np.sqrt(np.maximum(1 - tl**2, 0)), np.sqrt(np.maximum(1 - tv**2, 0))
    facing = np.clip((nl + 0.25) / 1.25, 0, 1)
    lit = (1 - finish.fibre) * np.maximum(nl, 0) + finish.fibre * sl * facing
    lobe = np.maximum(1 - finish.exponent / 16 * (1 - (sl * sv - tl * tv)), 0) ** 16
    openness = np.ones(len(p)) if p.openness is None else p.openness
    shadow = 1 - 0.6 * (1 - openness)
    gleam = finish.specular * lobe * facing * shadow
    gleam += finish.sheen * (1 - abs(nv)) ** 4 * (0.35 + 0.65 * facing) * openness
    fill = ground + (sky - ground) * (0.5 + 0.5 * p.normal[:, 1:2])
    body = p.colour * (fill * openness[:, None] + key * (lit * shadow)[:, None])
    return body + key * gleam[:, None] * (1 + finish.tint * (p.colour - 1))


def splat(
    p: Particles,
    camera: Camera,
    light: Lighting,
    finish: Finish,
    profile: Profile,
    sheet: SpriteSheet | None = None,
) -> np.ndarray:
    """Linear premultiplied RGBA (height, width, 4)."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rgba, through = np.zeros((camera.height, camera.width, 3)), np.ones((camera.height, camera.width))
    colours, pixels = shade(p, camera, light, finish), camera.project(p.position)
    to_light, (key, sky, ground) = light.towards_key(camera), light.radiances()
    key_share = key.sum() / (key.sum() + (sky + ground).sum() / 2)
    edge = 1.0 if sheet is not None else profile.edge
    for i in np.argsort(pixels[:, 2], kind="stable"):
        px, py, z = pixels[i]
        if z <= camera.near or p.radius[i] <= 0:
            continue
        dx, dy, scale = x - px, y - py, camera.focal / z
        b = p.radius[i] * scale
        t3 = camera.rotation @ p.tangent[i]
        on_image = np.array(
            [t3[0] - (px - camera.cx) / camera.focal * t3[2], t3[1] - (py - camera.cy) / camera.focal * t3[2]]
        )
        flat = endwise = 0.0
        if p.half_length is None:
            a, axis = b, np.array([1.0, 0.0])
        else:
            flat = min(on_image @ on_image, 1)
            a = np.sqrt(b**2 * (1 - flat) + (p.half_length[i] * scale) ** 2 * flat)
            axis = on_image / np.linalg.norm(on_image)
        if edge is not None:
            wide, long, alpha = np.sqrt(b**2 + 0.91), np.sqrt(a**2 + 0.91), 1.0
            alpha = a * b / (wide * long)
        elif p.half_length is None:
            faint = 2.3175 * b**2 + 0.91
            wide = long = min(np.sqrt(faint), 2 / 3 + np.sqrt(4 / 9 + b**2))
            alpha = min(3 * b**2 / faint, 1)
        else:
            endwise = max(1 - flat * (3 + (p.half_length[i] / p.radius[i]) ** 2 / 3), 0)
            faint = np.sqrt(3.09 * 225 / 256 * b**2 + 0.91)
            wide = min(faint, 2 / 3 + np.sqrt(0.64 + b**2))
            long = np.sqrt(a**2 + wide**2 - b**2)
            alpha = min(min(1.875 * b / faint, 1) * a / long * (1 + 0.6 * endwise), 1)
        even = 1.0
        if p.half_length is not None and sheet is None:  # a faint piece is drawn nearer to its yarn's axis
            curve, across = 0.5 * finish.roundness, np.linspace(-1, 1, 401)
            blunt = 1 / (edge or max(wide / 2, 1))
            disc = 1 / 4 - 3 / 16 * blunt + blunt**2 / 16
            rim = np.minimum((1 - across**2) / blunt, 1) ** 2
            square = disc if edge is not None else (across**2 @ rim / rim.sum()) * (1 - endwise) + disc * endwise
            even = 1 / (1 + curve * (1 / 4 - square))
            slim = min(max(p.half_length[i] / p.radius[i] - 1, 0), 1)
            inward = 0.55 * slim * max(wide - 1.875 * b, 0) * (camera.rotation @ p.normal[i])[:2]
            dx, dy = dx + inward[0], dy + inward[1]
        s, t = (axis[0] * dy - axis[1] * dx) / wide, (axis[0] * dx + axis[1] * dy) / long
        if sheet is not None:
            size, k = sheet.size, 0 if p.sprite is None else p.sprite[i]
            at = [(s + 1) * size / 2 - 0.5, (t + 1) * size / 2 - 0.5]
            q = np.sqrt(map_coordinates(sheet.alpha[k], at, order=1, mode="grid-constant"))
            q *= (abs(s) < 1) & (abs(t) < 1)
        elif edge is None and p.half_length is not None:
            q = np.clip(max(wide / 2, 1) * np.maximum(1 - s**2 - endwise * t**2, 0), 0, 1)
            q *= np.clip(np.maximum(1 - t**2, 0) / (1.001 - endwise), 0, 1)
        else:
            q = np.clip((edge or max(wide / 2, 1)) * (1 - s**2 - t**2), 0, 1)
        weight = through * alpha * np.broadcast_to(p.opacity, len(p))[i] * q**2
        through = through - weight
        if p.half_length is not None:
            view = (camera.eye - p.position[i]) / np.linalg.norm(camera.eye - p.position[i])
            across = np.cross(p.tangent[i], view)
            facing = np.clip((p.normal[i] @ to_light + 0.25) / 1.25, 0, 1)
            slope = across @ to_light / np.linalg.norm(across) * min(2 * facing, 1) * 0.6 * finish.roundness * key_share
            weight = weight * even * (1 + 0.5 * finish.roundness * (0.25 - s**2) + slope * s)
        rgba += weight[..., None] * colours[i]
    return np.concatenate([rgba, 1 - through[..., None]], axis=2)
