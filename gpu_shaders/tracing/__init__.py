"""Traced light on the graphics processor: shadows, reflections, refraction, ambient occlusion; docs/light.md has the formulas."""
