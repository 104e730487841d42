/* settings_channel.h: reads one `input = CHANNEL ...` line of a settings file (grammar in settings.h).
 *
 * CONTRACT
 *   As settings_text.h.
 */
#ifndef AEOLID_DISCON_SETTINGS_CHANNEL_H
#define AEOLID_DISCON_SETTINGS_CHANNEL_H

#include "settings.h"
#include "settings_text.h"

/* Add the channel that `value` describes, after the others of its role; 0 done, -1 refused. */
int channel_add(settings_t *self, const text_t *text, tap_role_t role, const char *key, char *value);

/* Add a channel of the table by its name, unless it is there already; 0 done, -1 no room. */
int channel_add_named(settings_t *self, const char *name);

#endif
/* SPDX-License-Identifier: MIT */
