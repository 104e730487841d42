/* A square root one unit in the last place too large: what -ffast-math may make of it on another processor, where a
 * filter that forgets nothing must still keep its covariance. */
#ifndef COARSE_CONFIG_H
#define COARSE_CONFIG_H

#include <float.h>
#include <math.h>

#define AEO_SQRT(x) (sqrtf(x) * (1 + FLT_EPSILON))

#endif
