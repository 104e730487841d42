/* The shown bare-metal block on a make-believe CAN controller with three mailboxes; frames go to standard output as a
 * log. A millisecond is a turn of the loop; the bus carries three frames in it. */
#include "harness.h"

#include "wiring.h"

static unsigned filled;
static int requested;

int mailbox_is_free(void)
{
    return filled < 3u;
}

void mailbox_fill(uint32_t id, const uint8_t *data, uint8_t length)
{
    unsigned i;
    filled++;
    (void)printf("(%u.%06u) can0 %08X#", (unsigned)(can.now_us / 1000000u), (unsigned)(can.now_us % 1000000u),
                 (unsigned)id);
    for (i = 0; i < length; i++) {
        (void)printf("%02X", data[i]);
    }
    (void)printf("\n");
}

void request_mailbox_interrupt(void)
{
    requested = 1;
}

int main(void)
{
    aeo_real_t u[INPUTS], y[OUTPUTS];
    uint32_t millisecond;
    if (!can_start()) {
        return 1;
    }
    for (millisecond = 0; millisecond < 25000u; millisecond++) {
        can.now_us += 1000u;
        if (millisecond % 100u == 0u) {
            harness_sensors(u, y);
            take_sample(u, y, millisecond / 100u);
        }
        background_task();
        if (filled > 0u || requested) {
            filled = 0;
            requested = 0;
            mailbox_is_free_interrupt();
        }
    }
    return can.locked == 0u ? 0 : 1;
}
