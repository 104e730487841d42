/* fuzz_wire.h: any bytes as frames from a bus, and as settings of a streamer whose port refuses as it likes. */
#ifndef FUZZ_WIRE_H
#define FUZZ_WIRE_H

#include <stddef.h>
#include <stdint.h>

/* Abort when a frame is read that does not say what it seems to, or a streamer breaks its contract. */
void fuzz_wire(const uint8_t *data, size_t bytes);

#endif
