/* fdcan_model.h: a make-believe FDCAN controller that keeps the rules of its reference manual and notes who breaks one.
 *
 * Its tables are written from RM0440 and RM0433, not from the port's. What is checked: registers exist, reserved bits stay
 * zero, protected registers change with INIT and CCE alone, CCE only once INIT reads 1, INIT only once the value before has
 * been accepted; message RAM is reached in whole words within the instance, never read before it was written; an element is
 * requested at the put index, written, free and with interrupts masked; one is read and acknowledged at the get index.
 */
#ifndef FDCAN_MODEL_H
#define FDCAN_MODEL_H

#include <aeolid/frame.h>

#define AEO_FDCAN_READ(address)         fdcan_model_read(address)
#define AEO_FDCAN_WRITE(address, value) fdcan_model_write((address), (value))
#define AEO_FDCAN_MASK()                fdcan_model_mask()
#define AEO_FDCAN_UNMASK(before)        fdcan_model_unmask(before)

uint32_t fdcan_model_read(uintptr_t address);
void fdcan_model_write(uintptr_t address, uint32_t value);
uint32_t fdcan_model_mask(void);
void fdcan_model_unmask(uint32_t before);

/* Power on: a controller at these addresses; its memory holds anything. */
void fdcan_model_start(int h7, uintptr_t registers, uintptr_t memory);

/* What happened that must not, in words; null when all is well. */
const char *fdcan_model_broken(void);

/* Let it never accept a write to CCCR, as without a clock; let it sleep. */
void fdcan_model_freeze(void);
void fdcan_model_sleep(void);

/* The bus takes the next frame; 0 when there is none, or the controller is not on the bus. */
int fdcan_model_transmit(aeo_can_frame_t *frame);

/* A frame arrives, `code` its length code; 1 when a filter let it in and there was room. */
int fdcan_model_arrive(const aeo_can_frame_t *frame, unsigned code, int remote);

/* Errors enough for passive or bus-off, a failed access to memory, so many times 11 recessive bits. */
void fdcan_model_become_passive(void);
void fdcan_model_become_bus_off(void);
void fdcan_model_fail_memory(void);
void fdcan_model_idle(unsigned times);

/* 1 while interrupt line 0 is raised and nobody masks it; what a register holds. */
int fdcan_model_interrupts(void);
uint32_t fdcan_model_register(uint32_t offset);
int fdcan_model_is_masked(void);

/* A more urgent context runs as soon as interrupts are let in again, once. */
void fdcan_model_interrupt_next(void (*urgent)(void));

#endif
