#include "demands.h"

#include <string.h>

static const uint16_t record[DEMANDS] = {RECORD_COMMAND_1, RECORD_COMMAND_1 + 1, RECORD_COMMAND_1 + 2, RECORD_COMMAND,
                                         RECORD_TORQUE_COMMAND};
enum { COLLECTIVE = 3, TORQUE = 4 };

static uint32_t read_bits(const float *swap, unsigned i)
{
    uint32_t bits;
    memcpy(&bits, swap + record[i] - 1, sizeof bits);
    return bits;
}

void demands_init(demands_t *self, const settings_t *settings)
{
    memset(self, 0, sizeof *self);
    excitation_init(&self->pitch, &settings->pitch);
    excitation_init(&self->torque, &settings->torque);
}

void demands_rewind(demands_t *self)
{
    excitation_rewind(&self->pitch);
    excitation_rewind(&self->torque);
}

void demands_restore(demands_t *self, float *swap)
{
    for (unsigned i = 0; i < DEMANDS; i++) {
        if (self->changed[i] != 0u && read_bits(swap, i) == self->sent[i]) {
            memcpy(swap + record[i] - 1, &self->own[i], sizeof self->own[i]);
        }
        self->changed[i] = 0;
    }
}

/* Write one demand with signal b of the excitation added; remember both. Returns what was added. */
static float add(demands_t *self, float *swap, unsigned i, const excitation_t *excitation, unsigned b)
{
    const float command = records_get(swap, record[i]);
    const float total = excitation_apply(excitation, b, command);
    const float added = (float)((double)total - (double)command);
    if (!(added < 0.0F || added > 0.0F)) {
        return 0.0F;
    }
    self->own[i] = read_bits(swap, i);
    swap[record[i] - 1] = total;
    self->sent[i] = read_bits(swap, i);
    self->changed[i] = 1;
    return added;
}

static void excite_pitch(demands_t *self, float *swap, double time_s)
{
    const int individual = records_individual(swap);
    const unsigned blades = records_blades(swap), demands = individual ? blades : 1u;
    const unsigned first = individual ? 0u : COLLECTIVE;
    uint8_t allowed[EXCITATION_BLADES] = {0, 0, 0}, all = 1;
    const uint8_t possible = demands_impossible(self, swap) == NULL;
    for (unsigned b = 0; b < demands; b++) {
        allowed[b] = possible && excitation_allowed(&self->pitch, records_get(swap, record[first + b]));
        all = all && allowed[b];
    }
    for (unsigned b = 0; b < EXCITATION_BLADES; b++) {
        allowed[b] = self->pitch.settings.form == FORM_INDIVIDUAL ? allowed[b] : all;
    }
    excitation_advance(&self->pitch, time_s, (double)records_get(swap, RECORD_AZIMUTH), blades, allowed);
    for (unsigned b = 0; b < demands; b++) {
        self->added[b] = add(self, swap, first + b, &self->pitch, b);
    }
    for (unsigned b = demands; b < EXCITATION_BLADES; b++) { /* one demand for all blades; no such blade */
        self->added[b] = individual ? 0.0F : self->added[0];
    }
}

void demands_excite(demands_t *self, float *swap, double time_s)
{
    if (!excitation_over(&self->pitch, time_s)) {
        excite_pitch(self, swap, time_s);
    } else {
        memset(self->added, 0, EXCITATION_BLADES * sizeof *self->added);
    }
    self->added[EXCITATION_BLADES] = 0.0F;
    if (!excitation_over(&self->torque, time_s)) {
        uint8_t allowed[EXCITATION_BLADES] = {0, 0, 0};
        allowed[0] = excitation_allowed(&self->torque, records_get(swap, RECORD_TORQUE_COMMAND)) != 0;
        excitation_advance(&self->torque, time_s, 0.0, 1, allowed);
        self->added[EXCITATION_BLADES] = add(self, swap, TORQUE, &self->torque, 0);
    }
}

const char *demands_impossible(const demands_t *self, const float *swap)
{
    if (self->pitch.settings.signal == SIGNAL_OFF) {
        return NULL;
    }
    if (records_get(swap, RECORD_PITCH_ACTUATOR) >= 0.5F) {
        return "[pitch excitation]: record 10 asks for pitch rates, so there is none; use a pitch position actuator";
    }
    if (self->pitch.settings.form != FORM_COLLECTIVE && !records_individual(swap)) {
        return "[pitch excitation] form: record 28 allows collective only, so there is none; set Ptch_Cntrl = 1";
    }
    return NULL;
}
/* SPDX-License-Identifier: MIT */
