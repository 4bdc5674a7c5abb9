// Kernel spheres that cover many cells: groups of threads for them, as an indirect dispatch wants it, how many asked for one, and
// the balls that got one.
layout(std430, binding = 6) buffer LargeOccluders {
    uint large_groups[3];
    uint large_count;
    uint large_balls[];
};
