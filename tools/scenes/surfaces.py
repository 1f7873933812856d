"""Surfaces made from colours and textures, and a summer sky as light from infinitely far away."""

from typing import Any

import cv2
import mitsuba as mi
import numpy as np

from .textures import fractal_noise

Colour = tuple[float, float, float] | np.ndarray | str
VERTEX_COLOUR = "vertex_color"


def linear(srgb: np.ndarray) -> np.ndarray:
    """Convert sRGB values, 0 to 1, to linear reflectance."""
    values = np.clip(np.asarray(srgb, dtype=np.float32), 0.0, 1.0)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def reflectance(colour: Colour, repeat: tuple[float, float] = (1.0, 1.0)) -> dict[str, Any]:
    """Return the reflectance of an sRGB triple, a texture ``(rows, columns, 3)`` or `VERTEX_COLOUR`."""
    if isinstance(colour, str):
        return {"type": "mesh_attribute", "name": colour}
    values = linear(np.asarray(colour))
    if values.ndim == 1:
        return {"type": "rgb", "value": values.tolist()}
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(values, dtype=np.float32)),
        "raw": True,
        "to_uv": mi.ScalarTransform4f().scale([repeat[0], repeat[1], 1.0]),
    }


def matte(colour: Colour, repeat: tuple[float, float] = (1.0, 1.0)) -> dict[str, Any]:
    """Return a matte surface: paper, stone, leaves, asphalt."""
    return _both_sides({"type": "diffuse", "reflectance": reflectance(colour, repeat)})


def glossy(colour: Colour, roughness: float = 0.2, repeat: tuple[float, float] = (1.0, 1.0)) -> dict[str, Any]:
    """Return a coloured base under a clear coat: varnished wood, plastic, car paint."""
    return _both_sides(
        {
            "type": "roughplastic",
            "diffuse_reflectance": reflectance(colour, repeat),
            "alpha": roughness,
            "nonlinear": True,
        }
    )


def metal(colour: Colour = (0.8, 0.8, 0.82), roughness: float = 0.3) -> dict[str, Any]:
    return _both_sides(
        {
            "type": "roughconductor",
            "material": "Al",
            "alpha": roughness,
            "specular_reflectance": reflectance(colour),
        }
    )


def _both_sides(surface: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "surface": surface}


SIZE = (1024, 2048)
SUN_RADIUS_DEGREES = 1.2  # wider than the real 0.27: thin haze, softer shadows


def sky(
    rng: np.random.Generator,
    *,
    sun_azimuth: float,
    sun_elevation: float,
    sun_strength: float = 3.0,
    cloudiness: float = 0.5,
) -> dict[str, Any]:
    """Return the emitter. `sun_azimuth` is in degrees clockwise from +y; `sun_strength` is the sun's irradiance."""
    direction = _directions()
    elevation = np.arcsin(np.clip(direction[..., 2], -1, 1))
    height = np.clip(elevation / (np.pi / 2), 0, 1)[..., None]
    light = (1 - height) ** 4 * np.array([0.72, 0.80, 0.88]) + (1 - (1 - height) ** 4) * np.array([0.16, 0.33, 0.72])
    cover = _clouds(direction, rng, cloudiness)[..., None]
    light = light * (1 - cover) + cover * np.array([0.95, 0.95, 0.97])
    light = np.where(direction[..., 2:] < 0, np.array([0.22, 0.21, 0.17]), light)

    azimuth, altitude = np.radians(sun_azimuth), np.radians(sun_elevation)
    sun = np.array([np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), np.sin(altitude)])
    radius = np.radians(SUN_RADIUS_DEGREES)
    disc = (direction @ sun > np.cos(radius))[..., None]
    light = light + disc * sun_strength / (np.pi * radius**2) * np.array([1.0, 0.93, 0.80])
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(light, dtype=np.float32)),
        "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
    }


def _directions() -> np.ndarray:
    """Return the world direction of every texel of Mitsuba's map, whose own pole is y, with the pole turned to z."""
    polar = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * np.pi
    turn = (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2 * np.pi
    polar, turn = np.meshgrid(polar, turn, indexing="ij")
    x, y, z = np.sin(turn) * np.sin(polar), np.cos(polar), -np.cos(turn) * np.sin(polar)
    return np.stack([x, -z, y], -1)


def _clouds(direction: np.ndarray, rng: np.random.Generator, cloudiness: float) -> np.ndarray:
    """Return the cloud cover, 0 to 1: noise on a flat layer overhead, seen in perspective."""
    layer = fractal_noise((1024, 1024), rng, slope=1.7, finest=3, coarsest=300)
    distance = 1 / np.clip(direction[..., 2] + 0.06, 0.03, None)
    columns, rows = ((60 * direction[..., axis] * distance).astype(np.float32) for axis in (0, 1))
    density = cv2.remap(layer, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    cover = np.clip((density - 1.2 + 2.0 * cloudiness) / 1.6, 0, 1)
    fade = np.clip(direction[..., 2] / 0.10, 0, 1)
    return cover * fade * 0.9
