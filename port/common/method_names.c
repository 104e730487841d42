/* method_names.c: one row a filter. */
#include "method_names.h"

#include <string.h>

enum { METHODS = 4 };

static const struct {
    const char *name;
    aeo_estimator_method_t method;
} methods[METHODS] = {{"rls", aeo_estimator_rls},
                      {"els", aeo_estimator_els},
                      {"fast-rls", aeo_estimator_fast_rls},
                      {"lattice", aeo_estimator_lattice}}; /* the order of aeo_method_t */

int method_number(const char *name)
{
    for (int i = 0; i < METHODS; i++) {
        if (strcmp(name, methods[i].name) == 0) {
            return i;
        }
    }
    return -1;
}

const char *method_name(unsigned number)
{
    return number < METHODS ? methods[number].name : NULL;
}

aeo_estimator_method_t method_of(unsigned number)
{
    return number < METHODS ? methods[number].method : NULL;
}
/* SPDX-License-Identifier: MIT */
