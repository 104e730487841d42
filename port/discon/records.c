#include "records.h"

#include <string.h>

static const named_record_t table[] = {
    {"pitch_command", "rad", SOURCE_COMMAND, 0},
    {"pitch_command_1", "rad", SOURCE_DEMANDED, 42},
    {"pitch_command_2", "rad", SOURCE_DEMANDED, 43},
    {"pitch_command_3", "rad", SOURCE_DEMANDED, 44},
    {"torque_command", "N m", SOURCE_DEMANDED, 47},
    {"yaw_rate_command", "rad/s", SOURCE_DEMANDED, 48},
    {"pitch", "rad", SOURCE_PITCH, 0},
    {"pitch_1", "rad", SOURCE_MEASURED, 4},
    {"pitch_2", "rad", SOURCE_MEASURED, 33},
    {"pitch_3", "rad", SOURCE_MEASURED, 34},
    {"generator_torque", "N m", SOURCE_MEASURED, 23},
    {"generator_speed", "rad/s", SOURCE_MEASURED, 20},
    {"rotor_speed", "rad/s", SOURCE_MEASURED, 21},
    {"shaft_power", "W", SOURCE_MEASURED, 14},
    {"power", "W", SOURCE_MEASURED, 15},
    {"yaw_error", "rad", SOURCE_MEASURED, 24},
    {"wind", "m/s", SOURCE_MEASURED, 27},
    {"nacelle_angle", "rad", SOURCE_MEASURED, 37},
    {"tower_fore_aft", "m/s^2", SOURCE_MEASURED, 53},
    {"tower_side_side", "m/s^2", SOURCE_MEASURED, 54},
    {"azimuth", "rad", SOURCE_MEASURED, 60},
    {"blade_root_out_1", "N m", SOURCE_MEASURED, 30},
    {"blade_root_out_2", "N m", SOURCE_MEASURED, 31},
    {"blade_root_out_3", "N m", SOURCE_MEASURED, 32},
    {"blade_root_in_1", "N m", SOURCE_MEASURED, 69},
    {"blade_root_in_2", "N m", SOURCE_MEASURED, 70},
    {"blade_root_in_3", "N m", SOURCE_MEASURED, 71},
    {"nacelle_roll", "rad/s^2", SOURCE_MEASURED, 82},
    {"nacelle_nod", "rad/s^2", SOURCE_MEASURED, 83},
    {"nacelle_yaw", "rad/s^2", SOURCE_MEASURED, 84},
    {"shaft_torque", "N m", SOURCE_MEASURED, 109},
    {"thrust", "N", SOURCE_MEASURED, 110},
    {"excitation_pitch", "rad", SOURCE_EXCITED_PITCH, 0},
    {"excitation_pitch_1", "rad", SOURCE_EXCITED_PITCH_AT, 0},
    {"excitation_pitch_2", "rad", SOURCE_EXCITED_PITCH_AT, 1},
    {"excitation_pitch_3", "rad", SOURCE_EXCITED_PITCH_AT, 2},
    {"excitation_torque", "N m", SOURCE_EXCITED_TORQUE, 0},
};

const named_record_t *records_at(size_t i)
{
    return i < sizeof table / sizeof *table ? &table[i] : NULL;
}

const named_record_t *records_find(const char *name)
{
    const named_record_t *entry;
    for (size_t i = 0; (entry = records_at(i)) != NULL; i++) {
        if (strcmp(name, entry->name) == 0) {
            return entry;
        }
    }
    return NULL;
}

float records_get(const float *swap, unsigned number)
{
    return swap[number - 1u];
}

int records_finite(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & UINT32_C(0x7F800000)) != UINT32_C(0x7F800000);
}

unsigned records_blades(const float *swap)
{
    const float blades = records_get(swap, RECORD_BLADES);
    return blades >= 0.5F && blades < 1.5F ? 1u : blades >= 1.5F && blades < 2.5F ? 2u : 3u;
}

int records_individual(const float *swap)
{
    const float mode = records_get(swap, RECORD_PITCH_MODE);
    return mode >= 0.5F && mode < 1.5F;
}
/* SPDX-License-Identifier: MIT */
