"""Densities of materials by the names that people type."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

MATERIALS: Mapping[str, float] = MappingProxyType(
    {
        "steel": 7850.0,
        "stainless steel": 7900.0,
        "cast iron": 7200.0,
        "aluminium": 2700.0,
        "aluminum": 2700.0,
        "magnesium": 1740.0,
        "titanium": 4500.0,
        "brass": 8500.0,
        "bronze": 8800.0,
        "copper": 8960.0,
        "zinc": 7140.0,
        "lead": 11340.0,
        "tungsten": 19300.0,
        "ABS": 1050.0,
        "PLA": 1240.0,
        "PETG": 1270.0,
        "nylon": 1140.0,
        "POM": 1410.0,
        "PTFE": 2200.0,
        "PVC": 1400.0,
        "polycarbonate": 1200.0,
        "acrylic": 1180.0,
        "rubber": 1100.0,
        "carbon fibre": 1600.0,
        "glass": 2500.0,
        "concrete": 2400.0,
        "oak": 700.0,
        "pine": 500.0,
        "plywood": 600.0,
        "ice": 917.0,
        "water": 1000.0,
    }
)
"""Typical densities [kg/m^3]; alloys, fillings and moisture change them by some per cent: give `density` where that
matters."""
