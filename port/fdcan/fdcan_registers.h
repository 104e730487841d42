/* fdcan_registers.h (internal): registers and message RAM of the FDCAN controllers, and how they are reached.
 *
 * MODEL
 *   G4 and H7 hold the same core. G4 has a fixed message RAM and fewer registers, so that those behind 0x80 and the bits of
 *   the interrupt register lie elsewhere: fdcan_layout_t has what differs.
 *
 * CONTRACT
 *   Memory: two constant tables. Registers and message RAM are read and written in whole words alone. AEO_FDCAN_HOOKS names a
 *   header that defines the accesses or the mask otherwise: BASEPRI, a kernel's critical section, a model of the registers.
 */
#ifndef AEOLID_FDCAN_REGISTERS_H
#define AEOLID_FDCAN_REGISTERS_H

#include "fdcan_port.h"

#ifdef AEO_FDCAN_HOOKS
#include AEO_FDCAN_HOOKS
#endif

#ifndef AEO_FDCAN_READ
#define AEO_FDCAN_READ(address)         (*(const volatile uint32_t *)(address))
#define AEO_FDCAN_WRITE(address, value) (*(volatile uint32_t *)(address) = (value))
#endif

/* Keep the interrupt and all contexts of the streamer out and return what was; put that back. */
#ifndef AEO_FDCAN_MASK
#if defined(__arm__)
static inline uint32_t fdcan_mask(void)
{
    uint32_t before;
    __asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(before) : : "memory");
    return before;
}
static inline void fdcan_unmask(uint32_t before)
{
    __asm volatile("msr primask, %0" : : "r"(before) : "memory");
}
#else /* the program's, as on a compiler without this assembly */
uint32_t fdcan_mask(void);
void fdcan_unmask(uint32_t before);
#endif
#define AEO_FDCAN_MASK()         fdcan_mask()
#define AEO_FDCAN_UNMASK(before) fdcan_unmask(before)
#endif

/* Registers by their distance from the instance, the same in both families. */
#define FDCAN_DBTP 0x0Cu /* timing of the data phase */
#define FDCAN_CCCR 0x18u /* control */
#define FDCAN_NBTP 0x1Cu /* timing */
#define FDCAN_PSR  0x44u /* protocol status */
#define FDCAN_TDCR 0x48u /* transmitter's delay */
#define FDCAN_IR   0x50u /* interrupts: 1 clears */
#define FDCAN_IE   0x54u
#define FDCAN_ILS  0x58u /* line of each */
#define FDCAN_ILE  0x5Cu /* line enabled */
#define FDCAN_GFC  0x80u /* frames that no filter matches; G4: and the lengths of the lists */
#define FDCAN_TXBC 0xC0u
#define FDCAN_TXFS 0xC4u /* TXFQS */

/* H7 alone: where things lie in message RAM, and how large they are. */
#define FDCAN_H7_SIDFC 0x84u
#define FDCAN_H7_XIDFC 0x88u
#define FDCAN_H7_RXF0C 0xA0u
#define FDCAN_H7_RXBC  0xACu
#define FDCAN_H7_RXF1C 0xB0u
#define FDCAN_H7_RXESC 0xBCu
#define FDCAN_H7_TXESC 0xC8u
#define FDCAN_H7_TXEFC 0xF0u

#define CCCR_INIT 0x0001u
#define CCCR_CCE  0x0002u
#define CCCR_ASM  0x0004u
#define CCCR_CSA  0x0008u
#define CCCR_CSR  0x0010u
#define CCCR_FDOE 0x0100u
#define CCCR_BRSE 0x0200u

#define PSR_EP 0x20u
#define PSR_EW 0x40u
#define PSR_BO 0x80u

#define DBTP_TDC   0x00800000u
#define GFC_REJECT 0x2Bu /* remote frames, and what no filter matches, of both kinds of identifiers */
#define ILE_LINE0  1u
#define ESC_64     7u /* bytes an element holds */

#define RXFS_LEVEL(status) ((status)&0x7Fu)
#define RXFS_GET(status)   (((status) >> 8) & 0x3Fu)
#define TXFS_FULL          0x00200000u
#define TXFS_PUT(status)   (((status) >> 16) & 0x1Fu)

/* First and second word of an element, sent or received. */
#define ELEMENT_XTD          0x40000000u
#define ELEMENT_BRS          0x00100000u
#define ELEMENT_FDF          0x00200000u
#define ELEMENT_DLC(code)    ((uint32_t)(code) << 16)
#define ELEMENT_CODE(second) (((second) >> 16) & 0xFu)
#define ELEMENT_WORDS        18u

/* Filters: identifier and mask, into RX FIFO 0. */
#define FILTER_STANDARD(id, mask) (0x88000000u | ((id) << 16) | (mask))
#define FILTER_EXTENDED_0(id)     (0x20000000u | (id))
#define FILTER_EXTENDED_1(mask)   (0x80000000u | (mask))

#define FDCAN_H7_RAM       0x4000AC00u
#define FDCAN_H7_RAM_BYTES 10240u

/* What differs between the families: registers, places in message RAM in bytes, interrupts. */
typedef struct {
    uint16_t rx_status, rx_acknowledge, tx_add, tx_interrupt;
    uint16_t filters_standard, filters_extended, rx, tx, bytes;
    uint8_t rx_count, tx_count;
    uint32_t received, lost, completed, memory, passive, bus_off;
} fdcan_layout_t;

extern const fdcan_layout_t fdcan_layouts[2];

static inline const fdcan_layout_t *fdcan_layout(const aeo_fdcan_t *self)
{
    return &fdcan_layouts[self->config.family];
}

static inline uint32_t fdcan_read(const aeo_fdcan_t *self, uint32_t offset)
{
    return AEO_FDCAN_READ(self->config.registers + offset);
}

static inline void fdcan_write(const aeo_fdcan_t *self, uint32_t offset, uint32_t value)
{
    AEO_FDCAN_WRITE(self->config.registers + offset, value);
}

/* Of fdcan_port.c, for init. */
void fdcan_fill_port(aeo_fdcan_t *self, aeo_port_t *port);

#endif
/* SPDX-License-Identifier: MIT */
