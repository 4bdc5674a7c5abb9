"""Traced light on the graphics processor: shadows, reflections, refraction, occlusion; docs/light.md has the formulas."""
