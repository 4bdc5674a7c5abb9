// A ball and its neighbours as the balls of a leaf: the entry 0 is the ball itself. No other ball adds to the density in its influence
// sphere.

uniform samplerBuffer balls_tx;      // centre in scene coordinates, influence radius R; in the order of space
uniform usamplerBuffer neighbours_tx; // places in that order
#if WITH_WEIGHTS
uniform samplerBuffer weights_tx;
#else
uniform float weight_of_all;
#endif
#if WITH_COLORS || WITH_VELOCITIES || WITH_BALLS
uniform usamplerBuffer order_tx;     // the number of the ball at each place
#endif
#if WITH_COLORS
uniform samplerBuffer colors_tx;     // three a ball
#endif
#if WITH_VELOCITIES
uniform samplerBuffer velocities_tx;
#endif

flat in uint v_place;
flat in uint v_first; // of the list
flat in uint v_count;

int leaf_place(uint entry) {
    return entry == 0u ? int(v_place) : int(texelFetch(neighbours_tx, int(v_first + entry - 1u)).x);
}

vec4 leaf_sphere(uint entry) {
    return texelFetch(balls_tx, leaf_place(entry));
}

float leaf_weight(uint entry) {
#if WITH_WEIGHTS
    return texelFetch(weights_tx, leaf_place(entry)).x;
#else
    return weight_of_all;
#endif
}

uint leaf_id(uint entry) {
#if WITH_COLORS || WITH_VELOCITIES || WITH_BALLS
    return texelFetch(order_tx, leaf_place(entry)).x;
#else
    return 0u;
#endif
}

#if WITH_COLORS
vec3 ball_color(uint id) {
    int at = int(3u * id);
    return vec3(texelFetch(colors_tx, at).x, texelFetch(colors_tx, at + 1).x, texelFetch(colors_tx, at + 2).x);
}
#endif

#if WITH_VELOCITIES
vec3 ball_velocity(uint id) {
    int at = int(3u * id);
    return vec3(texelFetch(velocities_tx, at).x, texelFetch(velocities_tx, at + 1).x, texelFetch(velocities_tx, at + 2).x);
}
#endif
