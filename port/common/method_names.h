/* method_names.h: the filters of the library by the names that users type, for programs that offer them all.
 *
 * MODEL
 *   none. Firmware names one method; the node in software, the wrapper and the replay of recordings take it from their user.
 *
 * CONTRACT
 *   Memory: none. Pure; may be called from anywhere.
 */
#ifndef AEOLID_METHOD_NAMES_H
#define AEOLID_METHOD_NAMES_H

#include <aeolid/estimator.h>

/* Return the method called `name` (rls, els, fast-rls, lattice) as aeo_method_t, -1 for any other. */
int method_number(const char *name);

/* Return the name of a method, and what aeo_estimator_init wants of it; null for any other number. */
const char *method_name(unsigned number);
aeo_estimator_method_t method_of(unsigned number);

#endif
/* SPDX-License-Identifier: MIT */
