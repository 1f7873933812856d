"""Surfaces made from a colour, a texture or the colours of a mesh's vertices."""

from typing import Any

import mitsuba as mi
import numpy as np

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
