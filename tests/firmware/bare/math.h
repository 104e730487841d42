/* The whole of <math.h> that the library needs. */
#ifndef BARE_MATH_H
#define BARE_MATH_H

float sqrtf(float x);
double sqrt(double x);

#endif
