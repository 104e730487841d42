/* fdcan_setup.c: bit timing, message RAM and the way onto the bus; see fdcan_port.h. */
#include "fdcan_registers.h"

#include <aeolid/status.h>

#include <stddef.h>

#define STANDARD_ID_MAX UINT32_C(0x7FF)
#define EXTENDED_ID_MAX UINT32_C(0x1FFFFFFF)

const fdcan_layout_t fdcan_layouts[2] = {{.rx_status = 0x90,
                                          .rx_acknowledge = 0x94,
                                          .tx_add = 0xCC,
                                          .tx_interrupt = 0xDC,
                                          .filters_standard = 0,
                                          .filters_extended = 0x70,
                                          .rx = 0xB0,
                                          .tx = 0x278,
                                          .bytes = 0x350,
                                          .rx_count = 3,
                                          .tx_count = 3,
                                          .received = 1u << 0,
                                          .lost = 1u << 2,
                                          .completed = 1u << 7,
                                          .memory = 1u << 14,
                                          .passive = 1u << 17,
                                          .bus_off = 1u << 19},
                                         {.rx_status = 0xA4,
                                          .rx_acknowledge = 0xA8,
                                          .tx_add = 0xD0,
                                          .tx_interrupt = 0xE0,
                                          .filters_standard = 0,
                                          .filters_extended = 0x70,
                                          .rx = 0xB0,
                                          .tx = 0x530,
                                          .bytes = 3632,
                                          .rx_count = 16,
                                          .tx_count = 32,
                                          .received = 1u << 0,
                                          .lost = 1u << 3,
                                          .completed = 1u << 9,
                                          .memory = 1u << 17,
                                          .passive = 1u << 23,
                                          .bus_off = 1u << 25}};

/* ---- bit timing -------------------------------------------------------------------------------------------------- */

/* Largest prescaler and lengths of the two parts of a bit; least lengths. */
typedef struct {
    uint32_t prescaler, before, after, least;
} limits_t;

static const limits_t limits[2] = {{512, 256, 128, 2}, {32, 32, 16, 1}};

static int timing_is_sound(const aeo_fdcan_timing_t *timing, const limits_t *limit)
{
    return timing->prescaler >= 1u && timing->prescaler <= limit->prescaler && timing->before >= limit->least &&
           timing->before <= limit->before && timing->after >= limit->least && timing->after <= limit->after &&
           timing->jump >= 1u && timing->jump <= timing->after;
}

int aeo_fdcan_find_timing(aeo_fdcan_timing_t *timing, uint32_t clock_hz, uint32_t bits_per_s, uint32_t sample_permille,
                          int data)
{
    const limits_t *limit = &limits[data != 0];
    uint32_t prescaler;
    if (timing == NULL || bits_per_s == 0u || sample_permille < 500u || sample_permille > 950u ||
        clock_hz % bits_per_s != 0u) {
        return AEO_E_ARG;
    }
    for (prescaler = 1; prescaler <= limit->prescaler; prescaler++) {
        const uint32_t ticks = clock_hz / bits_per_s, quanta = ticks / prescaler;
        uint32_t to_sample, after;
        if (ticks % prescaler != 0u || quanta > 1u + limit->before + limit->after) {
            continue; /* and so quanta <= 385: the product below is small */
        }
        to_sample = (quanta * sample_permille + 500u) / 1000u;
        after = quanta - to_sample;
        if (to_sample > limit->least && to_sample - 1u <= limit->before && after >= limit->least &&
            after <= limit->after) {
            timing->prescaler = (uint16_t)prescaler;
            timing->before = (uint16_t)(to_sample - 1u);
            timing->after = (uint16_t)after;
            timing->jump = (uint16_t)(after < to_sample ? after : to_sample - 1u);
            return AEO_OK;
        }
    }
    return AEO_E_ARG;
}

/* ---- what a configuration must be -------------------------------------------------------------------------------- */

static int filters_are_sound(const aeo_fdcan_config_t *config)
{
    uint32_t standard = 0, extended = 0, i;
    if (config->filter_count > 0u && config->filters == NULL) {
        return 0;
    }
    for (i = 0; i < config->filter_count; i++) {
        const aeo_fdcan_filter_t *filter = &config->filters[i];
        const uint32_t most = filter->extended != 0u ? EXTENDED_ID_MAX : STANDARD_ID_MAX;
        if (filter->id > most || filter->mask > most) {
            return 0;
        }
        extended += filter->extended != 0u ? 1u : 0u;
        standard += filter->extended != 0u ? 0u : 1u;
    }
    return standard <= AEO_FDCAN_FILTERS_STANDARD && extended <= AEO_FDCAN_FILTERS_EXTENDED;
}

static int memory_is_sound(const aeo_fdcan_config_t *config)
{
    if (config->memory % 4u != 0u || config->registers == 0u || config->memory == 0u) {
        return 0;
    }
    return config->family == (uint8_t)AEO_FDCAN_G4 ||
           (config->memory >= FDCAN_H7_RAM &&
            config->memory - FDCAN_H7_RAM <= FDCAN_H7_RAM_BYTES - fdcan_layouts[AEO_FDCAN_H7].bytes);
}

static int config_is_sound(const aeo_fdcan_config_t *config)
{
    return config->family <= (uint8_t)AEO_FDCAN_H7 && memory_is_sound(config) &&
           timing_is_sound(&config->nominal, &limits[0]) &&
           (config->fd == 0u || timing_is_sound(&config->data, &limits[1])) && filters_are_sound(config);
}

/* ---- set-up ------------------------------------------------------------------------------------------------------ */

/* Wait until the bits of CCCR are as wanted; the two clock domains take some periods. */
static int wait_for(const aeo_fdcan_t *self, uint32_t bits, uint32_t wanted)
{
    uint32_t tries;
    for (tries = 0; tries < AEO_FDCAN_TRIES; tries++) {
        if ((fdcan_read(self, FDCAN_CCCR) & bits) == wanted) {
            return 1;
        }
    }
    return 0;
}

/* Stop the controller and open its protected registers. INIT is read back before anything else is written. */
static int stop(const aeo_fdcan_t *self)
{
    if ((fdcan_read(self, FDCAN_CCCR) & (CCCR_CSA | CCCR_CSR)) != 0u) {
        fdcan_write(self, FDCAN_CCCR, fdcan_read(self, FDCAN_CCCR) & ~CCCR_CSR); /* it sleeps */
        if (!wait_for(self, CCCR_CSA, 0)) {
            return 0;
        }
    }
    fdcan_write(self, FDCAN_CCCR, fdcan_read(self, FDCAN_CCCR) | CCCR_INIT);
    if (!wait_for(self, CCCR_INIT, CCCR_INIT)) {
        return 0;
    }
    fdcan_write(self, FDCAN_CCCR, fdcan_read(self, FDCAN_CCCR) | CCCR_CCE);
    return wait_for(self, CCCR_INIT | CCCR_CCE, CCCR_INIT | CCCR_CCE);
}

static void set_timing(const aeo_fdcan_t *self)
{
    const aeo_fdcan_timing_t *nominal = &self->config.nominal, *data = &self->config.data;
    fdcan_write(self, FDCAN_NBTP,
                (nominal->jump - 1u) << 25 | (nominal->prescaler - 1u) << 16 | (nominal->before - 1u) << 8 |
                    (nominal->after - 1u));
    if (self->config.fd != 0u) {
        const uint32_t offset = data->prescaler * (1u + data->before); /* periods to the sample point: at most 66 */
        const int compensates = data->prescaler <= 2u;
        fdcan_write(self, FDCAN_TDCR, compensates ? offset << 8 : 0u);
        fdcan_write(self, FDCAN_DBTP,
                    (compensates ? DBTP_TDC : 0u) | (data->prescaler - 1u) << 16 | (data->before - 1u) << 8 |
                        (data->after - 1u) << 4 | (data->jump - 1u));
    }
}

static void set_filters(const aeo_fdcan_t *self, uint32_t *standard, uint32_t *extended)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const uintptr_t base = self->config.memory;
    uint32_t i;
    *standard = 0;
    *extended = 0;
    for (i = 0; i < self->config.filter_count; i++) {
        const aeo_fdcan_filter_t *filter = &self->config.filters[i];
        if (filter->extended != 0u) {
            const uintptr_t place = base + layout->filters_extended + 8u * (*extended)++;
            AEO_FDCAN_WRITE(place, FILTER_EXTENDED_0(filter->id));
            AEO_FDCAN_WRITE(place + 4u, FILTER_EXTENDED_1(filter->mask));
        } else {
            const uintptr_t place = base + layout->filters_standard + 4u * (*standard)++;
            AEO_FDCAN_WRITE(place, FILTER_STANDARD(filter->id, filter->mask));
        }
    }
}

/* H7 comes up with any contents, and a word that was never written may fail its check. */
static void set_memory(const aeo_fdcan_t *self)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    uint32_t offset, standard, extended;
    for (offset = 0; offset < layout->bytes; offset += 4u) {
        AEO_FDCAN_WRITE(self->config.memory + offset, 0);
    }
    set_filters(self, &standard, &extended);
    if (self->config.family == (uint8_t)AEO_FDCAN_G4) {
        fdcan_write(self, FDCAN_GFC, GFC_REJECT | standard << 16 | extended << 24);
        fdcan_write(self, FDCAN_TXBC, 0); /* a FIFO, no queue */
    } else {
        const uint32_t at = (uint32_t)(self->config.memory - FDCAN_H7_RAM); /* bits 15 ... 2: a multiple of 4 */
        fdcan_write(self, FDCAN_GFC, GFC_REJECT);
        fdcan_write(self, FDCAN_H7_SIDFC, standard << 16 | (at + layout->filters_standard));
        fdcan_write(self, FDCAN_H7_XIDFC, extended << 16 | (at + layout->filters_extended));
        fdcan_write(self, FDCAN_H7_RXF0C, (uint32_t)layout->rx_count << 16 | (at + layout->rx));
        fdcan_write(self, FDCAN_H7_RXF1C, 0);
        fdcan_write(self, FDCAN_H7_RXBC, 0);
        fdcan_write(self, FDCAN_H7_RXESC, ESC_64);
        fdcan_write(self, FDCAN_H7_TXESC, ESC_64);
        fdcan_write(self, FDCAN_H7_TXEFC, 0);
        fdcan_write(self, FDCAN_TXBC, (uint32_t)layout->tx_count << 24 | (at + layout->tx));
    }
}

static void set_interrupts(const aeo_fdcan_t *self)
{
    const fdcan_layout_t *layout = fdcan_layout(self);
    const uint32_t told =
        layout->received | layout->lost | layout->completed | layout->memory | layout->passive | layout->bus_off;
    fdcan_write(self, layout->tx_interrupt, UINT32_MAX >> (32u - layout->tx_count));
    fdcan_write(self, FDCAN_IR, fdcan_read(self, FDCAN_IR)); /* what was before */
    fdcan_write(self, FDCAN_ILS, 0);
    fdcan_write(self, FDCAN_IE, told);
    fdcan_write(self, FDCAN_ILE, ILE_LINE0);
}

int aeo_fdcan_init(aeo_fdcan_t *self, const aeo_fdcan_config_t *config, aeo_port_t *port)
{
    uint32_t mode;
    if (self == NULL || config == NULL || port == NULL || !config_is_sound(config)) {
        return AEO_E_ARG;
    }
    self->config = *config;
    self->counters = (aeo_fdcan_counters_t){0, 0, 0, 0};
    self->head = 0;
    self->tail = 0;
    self->masked = 0;
    if (!stop(self)) {
        return AEO_FDCAN_E_STUCK;
    }
    mode = config->fd != 0u ? CCCR_FDOE | CCCR_BRSE : 0u;
    set_timing(self);
    set_memory(self);
    fdcan_write(self, FDCAN_CCCR, CCCR_INIT | CCCR_CCE | mode);
    set_interrupts(self);
    self->config.filters = NULL;
    fdcan_fill_port(self, port);
    fdcan_write(self, FDCAN_CCCR, mode); /* off it goes, after 11 recessive bits */
    return AEO_OK;
}
/* SPDX-License-Identifier: MIT */
