// The depth that a fragment writes is never nearer than that of its triangle, so the driver may drop hidden ones unseen.
#ifdef GL_ARB_conservative_depth
#extension GL_ARB_conservative_depth : enable
layout(depth_greater) out float gl_FragDepth;
#endif
