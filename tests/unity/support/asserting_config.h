/* Switch the library's proofs on in a test build: a bound that does not hold ends the test. */
#ifndef ASSERTING_CONFIG_H
#define ASSERTING_CONFIG_H

#include <assert.h>

#define AEO_ASSERT(condition) assert(condition)

#endif
