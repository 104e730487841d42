/* crc.c: the CRC-32 of frame.h, in an object of its own: filters seal their saved arrays with it and need no frames. */
#include "aeolid/frame.h"

uint32_t aeo_frame_crc32(uint32_t crc, uint32_t word)
{
    static const uint32_t table[16] = {
        UINT32_C(0x00000000), UINT32_C(0x1DB71064), UINT32_C(0x3B6E20C8), UINT32_C(0x26D930AC),
        UINT32_C(0x76DC4190), UINT32_C(0x6B6B51F4), UINT32_C(0x4DB26158), UINT32_C(0x5005713C),
        UINT32_C(0xEDB88320), UINT32_C(0xF00F9344), UINT32_C(0xD6D6A3E8), UINT32_C(0xCB61B38C),
        UINT32_C(0x9B64C2B0), UINT32_C(0x86D3D2D4), UINT32_C(0xA00AE278), UINT32_C(0xBDBDF21C)};
    unsigned i;
    crc ^= word; /* reflected: the four bytes, least significant first, in one go */
    for (i = 0; i < 8u; i++) {
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return crc;
}
/* SPDX-License-Identifier: MIT */
