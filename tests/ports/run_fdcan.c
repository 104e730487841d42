/* The shown FDCAN block on a model of the controller's registers; frames go to standard output as a log. A millisecond is
 * a turn of the loop; the bus carries three frames in it. */
#include "harness.h"

#include "wiring.h"

#include "fdcan_model.h"

static uint32_t now_us;

uint32_t read_timer_us(void)
{
    return now_us;
}

static void write_log(const aeo_can_frame_t *frame)
{
    unsigned i;
    (void)printf("(%u.%06u) can0 %08X#", (unsigned)(now_us / 1000000u), (unsigned)(now_us % 1000000u),
                 (unsigned)frame->id);
    for (i = 0; i < frame->length; i++) {
        (void)printf("%02X", frame->data[i]);
    }
    (void)printf("\n");
}

int main(void)
{
    aeo_real_t u[INPUTS], y[OUTPUTS];
    aeo_can_frame_t frame;
    uint32_t millisecond;
    unsigned slot;
    fdcan_model_start(0, AEO_FDCAN_G4_REGISTERS(1), AEO_FDCAN_G4_MEMORY(1));
    if (!can_start()) {
        return 1;
    }
    fdcan_model_idle(1);
    for (millisecond = 0; millisecond < 25000u; millisecond++) {
        now_us += 1000u;
        if (millisecond % 100u == 0u) {
            harness_sensors(u, y);
            take_sample(u, y, millisecond / 100u);
        }
        background_task();
        for (slot = 0; slot < 3u && fdcan_model_transmit(&frame); slot++) {
            write_log(&frame);
            while (fdcan_model_interrupts()) {
                FDCAN1_IT0_IRQHandler();
            }
        }
    }
    return fdcan_model_broken() == NULL && aeo_fdcan_waiting(&can) == 0u ? 0 : 2;
}
