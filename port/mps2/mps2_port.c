#include "mps2_port.h"

#include "../posix/slcan.h"
#include "mps2_board.h"

#define UART(offset)   MPS2_REGISTER(0x40004000u + (offset))
#define UART_DATA      UART(0x00u)
#define UART_STATE     UART(0x04u)
#define UART_CONTROL   UART(0x08u)
#define UART_INTERRUPT UART(0x0Cu) /* writing a one clears */
#define UART_DIVIDER   UART(0x10u)
#define TRANSMIT       1u   /* in state: buffer full; in interrupt: buffer has become free */
#define RECEIVE        2u   /* in state and interrupt: a character has come */
#define ENABLE_ALL     0xFu /* transmitter, receiver and their interrupts */

#define TIMER(offset) MPS2_REGISTER(0x40000000u + (offset))
#define TIMER_CONTROL TIMER(0x00u)
#define TIMER_VALUE   TIMER(0x04u)
#define TIMER_RELOAD  TIMER(0x08u)
#define TICKS_PER_US  (MPS2_CLOCK_HZ / 1000000u)

/* ---- callbacks of the streamer ----------------------------------------------------------------------------------- */

/* Put a text into the ring whole, or not at all; the caller keeps other writers out. */
static int put(mps2_port_t *self, const char *text, size_t length)
{
    const uint32_t head = self->head;
    size_t i;
    if (MPS2_RING - (head - self->tail) < length) {
        return 0;
    }
    for (i = 0; i < length; i++) {
        self->ring[(head + i) % MPS2_RING] = (uint8_t)text[i];
    }
    mps2_barrier(); /* the text is there before the head says so */
    self->head = head + (uint32_t)length;
    mps2_raise(MPS2_UART0_TRANSMIT); /* a UART that had nothing to send raises none itself */
    return 1;
}

static int send(void *context, const aeo_can_frame_t *frame)
{
    mps2_port_t *self = (mps2_port_t *)context;
    char line[SLCAN_LINE_MAX];
    return self->open == 0u || put(self, line, slcan_format(frame, line));
}

/* Microseconds that wrap at 2^32, from a timer that wraps every 171 s. Called under lock. */
static uint32_t read_clock(void *context)
{
    mps2_port_t *self = (mps2_port_t *)context;
    const uint32_t value = TIMER_VALUE, passed = self->timer - value;
    const uint32_t rest = self->rest + passed % TICKS_PER_US;
    self->timer = value;
    self->clock_us += passed / TICKS_PER_US + rest / TICKS_PER_US;
    self->rest = rest % TICKS_PER_US;
    return self->clock_us;
}

static void lock(void *context)
{
    const uint32_t primask = mps2_mask();
    ((mps2_port_t *)context)->primask = primask; /* only now: the context that had the lock before has let it go */
}

static void unlock(void *context)
{
    mps2_unmask(((const mps2_port_t *)context)->primask);
}

void mps2_port_init(mps2_port_t *self, aeo_port_t *port, uint32_t baud)
{
    self->head = 0;
    self->tail = 0;
    self->open = 0;
    self->rest = 0;
    self->clock_us = 0;
    self->length = 0;
    TIMER_CONTROL = 0;
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE = UINT32_MAX;
    TIMER_CONTROL = 1;
    self->timer = TIMER_VALUE;
    UART_DIVIDER = MPS2_CLOCK_HZ / baud;
    UART_CONTROL = ENABLE_ALL;
    mps2_enable(MPS2_UART0_TRANSMIT, MPS2_LEAST_URGENT);
    mps2_enable(MPS2_UART0_RECEIVE, MPS2_LEAST_URGENT);
    port->context = self;
    port->send = send;
    port->time_us = read_clock;
    port->lock = lock;
    port->unlock = unlock;
}

/* ---- interrupts -------------------------------------------------------------------------------------------------- */

static int is_setting(char letter)
{
    static const char letters[] = "SsFZMmWX";
    size_t i;
    for (i = 0; i < sizeof letters - 1u; i++) {
        if (letters[i] == letter) {
            return 1;
        }
    }
    return 0;
}

/* Obey or answer the command received. An answer that finds no room is not given. */
static void obey(mps2_port_t *self)
{
    const char letter = self->length == 1u || is_setting(self->letter) ? self->letter : '\0';
    const char *answer = "\r";
    uint32_t primask;
    if (letter == 'O' || letter == 'L') {
        self->open = 1;
    } else if (letter == 'C') {
        self->open = 0;
    } else if (letter == 'V') {
        answer = "V1013\r";
    } else if (letter == 'N') {
        answer = "NAEOL\r";
    } else if (!is_setting(letter)) {
        answer = "\a";
    }
    primask = mps2_mask();
    (void)put(self, answer, answer[1] == '\0' ? 1u : 6u);
    mps2_unmask(primask);
}

static void take(mps2_port_t *self, char character)
{
    if (character == '\r') {
        if (self->length > 0u) {
            obey(self);
        }
        self->length = 0;
    } else if (self->length < UINT8_MAX) {
        self->letter = self->length == 0u ? character : self->letter;
        self->length++;
    }
}

void mps2_port_serve(mps2_port_t *self)
{
    const uint32_t tail = self->tail;
    UART_INTERRUPT = TRANSMIT | RECEIVE; /* before the state is read: what happens in between raises them again */
    if ((UART_STATE & RECEIVE) != 0u) {
        take(self, (char)(UART_DATA & 0x7Fu));
    }
    if (self->head != tail && (UART_STATE & TRANSMIT) == 0u) {
        UART_DATA = self->ring[tail % MPS2_RING];
        self->tail = tail + 1u;
    }
}

uint32_t mps2_port_waiting(const mps2_port_t *self)
{
    return self->head - self->tail;
}
/* SPDX-License-Identifier: MIT */
