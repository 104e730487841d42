/* The POSIX port: slcan text both ways, rings that fill, listeners that come, hang and go; the template's ring; and what
 * the SocketCAN port says where nothing can be opened. Where something can, tests/sil/uml runs it. */
#include "aeolid/status.h"
#include "port_template.h"
#include "posix_bus.h"
#include "slcan.h"
#include "socketcan.h"
#include "unity.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

static posix_bus_t bus;
static aeo_port_t port;

void setUp(void)
{
}

void tearDown(void)
{
}

static aeo_can_frame_t make_frame(uint8_t flags, uint8_t length)
{
    aeo_can_frame_t frame;
    unsigned i;
    memset(&frame, 0, sizeof frame);
    frame.id = (flags & AEO_CAN_EXTENDED) != 0u ? 0x1CFF4201u : 0x612u;
    frame.flags = flags;
    frame.length = length;
    for (i = 0; i < length; i++) {
        frame.data[i] = (uint8_t)(0xF0u + i);
    }
    return frame;
}

static void text_is_that_of_the_adapter(void)
{
    char line[SLCAN_LINE_MAX];
    aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    TEST_ASSERT_EQUAL_size_t(27, slcan_format(&frame, line));
    TEST_ASSERT_EQUAL_STRING_LEN("T1CFF42018F0F1F2F3F4F5F6F7\r", line, 27);
    frame = make_frame(0, 2);
    TEST_ASSERT_EQUAL_size_t(10, slcan_format(&frame, line));
    TEST_ASSERT_EQUAL_STRING_LEN("t6122F0F1\r", line, 10);
    frame = make_frame(AEO_CAN_EXTENDED | AEO_CAN_FD | AEO_CAN_BRS, 12);
    TEST_ASSERT_EQUAL_size_t(35, slcan_format(&frame, line));
    TEST_ASSERT_EQUAL_STRING_LEN("B1CFF42019F0F1F2F3F4F5F6F7F8F9FAFB\r", line, 35);
    frame.length = 13;
    TEST_ASSERT_EQUAL_size_t(0, slcan_format(&frame, line));
    frame = make_frame(AEO_CAN_EXTENDED, 12); /* too long for a classic frame */
    TEST_ASSERT_EQUAL_size_t(0, slcan_format(&frame, line));
    frame = make_frame(0, 8);
    frame.id = 0x800;
    TEST_ASSERT_EQUAL_size_t(0, slcan_format(&frame, line));
}

static void every_shape_goes_there_and_back(void)
{
    static const uint8_t lengths[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    static const uint8_t flags[] = {0, 1, 2, 3, 6, 7};
    unsigned i, j;
    for (i = 0; i < sizeof flags; i++) {
        for (j = 0; j < sizeof lengths; j++) {
            const aeo_can_frame_t frame = make_frame(flags[i], lengths[j]);
            aeo_can_frame_t back;
            char line[SLCAN_LINE_MAX];
            const size_t length = slcan_format(&frame, line);
            if (lengths[j] > 8u && (flags[i] & AEO_CAN_FD) == 0u) {
                TEST_ASSERT_EQUAL_size_t(0, length);
                continue;
            }
            TEST_ASSERT_EQUAL_INT(1, slcan_parse(line, length - 1u, &back));
            TEST_ASSERT_EQUAL_MEMORY(&frame, &back, sizeof frame);
            TEST_ASSERT_EQUAL_INT(0, slcan_parse(line, length, &back)); /* one character too many */
            if (length > 1u) {
                TEST_ASSERT_EQUAL_INT(0, slcan_parse(line, length - 2u, &back)); /* cut */
            }
        }
    }
}

static void broken_text_is_no_frame(void)
{
    static const char *const texts[] = {"",
                                        "T",
                                        "T1CFF4201",
                                        "X1CFF42018F0F1F2F3F4F5F6F7",
                                        "T1CFF42018F0F1F2F3F4F5F6G7",
                                        "TFFFFFFFF8F0F1F2F3F4F5F6F7",
                                        "t8000",
                                        "t6129F0",
                                        "r6128"};
    aeo_can_frame_t frame, before;
    unsigned i;
    memset(&frame, 0x5A, sizeof frame);
    before = frame;
    for (i = 0; i < sizeof texts / sizeof *texts; i++) {
        TEST_ASSERT_EQUAL_INT(0, slcan_parse(texts[i], strlen(texts[i]), &frame));
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &frame, sizeof frame);
}

/* ---- listeners --------------------------------------------------------------------------------------------------- */

static int connect_to_bus(void)
{
    struct sockaddr_in address;
    const char *colon = strrchr(bus.address, ':');
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons((uint16_t)strtoul(colon + 1, NULL, 10));
    TEST_ASSERT_EQUAL_INT(0, connect(fd, (struct sockaddr *)&address, sizeof address));
    return fd;
}

static void say(int fd, const char *text)
{
    unsigned i;
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)write(fd, text, strlen(text)));
    for (i = 0; i < 5u; i++) {
        (void)posix_bus_poll(&bus, -1, 10);
    }
}

/* Read until `length` characters are there, while the bus moves. */
static void expect(int fd, const char *text, size_t length)
{
    char got[512];
    size_t have = 0;
    unsigned i;
    (void)fcntl(fd, F_SETFL, O_NONBLOCK);
    for (i = 0; i < 500u && have < length; i++) {
        ssize_t n;
        (void)posix_bus_poll(&bus, -1, 10);
        n = read(fd, got + have, length - have);
        have += n > 0 ? (size_t)n : 0u;
    }
    TEST_ASSERT_EQUAL_size_t(length, have);
    TEST_ASSERT_EQUAL_STRING_LEN(text, got, length);
}

static void listeners_come_and_go(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    int first, second;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    posix_bus_port(&bus, &port);
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame)); /* nobody listens: taken and lost */
    first = connect_to_bus();
    second = connect_to_bus();
    say(first, "V\r");
    TEST_ASSERT_EQUAL_UINT(0, posix_bus_listeners(&bus)); /* a question opens nothing */
    say(first, "O\r");
    TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    expect(first, "V1013\r\rT1CFF42018F0F1F2F3F4F5F6F7\r", 34);
    say(second, "L\r");
    TEST_ASSERT_EQUAL_UINT(2, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    expect(second, "\rT1CFF42018F0F1F2F3F4F5F6F7\r", 28); /* joined late: only what came since */
    expect(first, "T1CFF42018F0F1F2F3F4F5F6F7\r", 27);
    say(first, "C\r");
    TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
    close(second);
    (void)posix_bus_poll(&bus, -1, 100);
    TEST_ASSERT_EQUAL_UINT(0, posix_bus_listeners(&bus));
    close(first);
    posix_bus_close(&bus);
}

/* One listener that does not read: every frame is taken or refused, none waits; a second listener is not held back. */
static void a_full_ring_refuses(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    unsigned taken = 0, i;
    int lazy, eager;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    posix_bus_port(&bus, &port);
    lazy = connect_to_bus();
    say(lazy, "O\r");
    for (i = 0; i < 20000u; i++) {
        taken += (unsigned)port.send(port.context, &frame);
    }
    TEST_ASSERT_UINT_WITHIN(2, POSIX_BUS_RING / 27u, taken);
    TEST_ASSERT_EQUAL_UINT32(20000u - taken, bus.refused);
    TEST_ASSERT_EQUAL_size_t(0, posix_bus_room(&bus));
    bus.refused = UINT32_MAX; /* after years: it stays there */
    TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, bus.refused);
    eager = connect_to_bus();
    (void)posix_bus_poll(&bus, -1, 100);
    bus.listener[0].tail = bus.listener[0].head - (POSIX_BUS_RING - 10u); /* full but for ten characters */
    say(eager, "O\r");
    bus.listener[0].tail = bus.listener[0].head - (POSIX_BUS_RING - 10u);
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    TEST_ASSERT_EQUAL_UINT32(1, posix_bus_dropped(&bus));
    posix_bus_abandon(&bus, POSIX_BUS_RING / 2u);
    TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_UINT32(1, posix_bus_dropped(&bus));
    bus.dropped = UINT32_MAX;
    bus.listener[1].dropped = 5;
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, posix_bus_dropped(&bus));
    close(lazy);
    close(eager);
    posix_bus_close(&bus);
}

/* Connect, and let the bus take the peer in. */
static int arrive(void)
{
    const int fd = connect_to_bus();
    (void)posix_bus_poll(&bus, -1, 100);
    return fd;
}

static int is_turned_out(int fd)
{
    char byte;
    (void)fcntl(fd, F_SETFL, O_NONBLOCK);
    return read(fd, &byte, 1) == 0;
}

/* All places are taken by listeners that read: one more is turned away, and none of them loses anything. */
static void too_many_listeners_are_turned_away(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    int fd[POSIX_BUS_LISTENERS + 1];
    unsigned i;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    posix_bus_port(&bus, &port);
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        fd[i] = arrive();
        say(fd[i], "O\r");
        expect(fd[i], "\r", 1);
    }
    fd[i] = arrive();
    TEST_ASSERT_TRUE(is_turned_out(fd[i]));
    TEST_ASSERT_EQUAL_UINT(POSIX_BUS_LISTENERS, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        expect(fd[i], "T1CFF42018F0F1F2F3F4F5F6F7\r", 27);
    }
    for (i = 0; i < POSIX_BUS_LISTENERS + 1u; i++) {
        close(fd[i]);
    }
    posix_bus_close(&bus);
}

/* Peers that say nothing, or drip characters of no command, hold every place: whoever comes next gets the oldest one's,
 * again and again, and a listener that has opened its channel keeps its own. */
static void silent_peers_lock_nobody_out(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    int fd[3 * POSIX_BUS_LISTENERS], open_one, late;
    unsigned i;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    posix_bus_port(&bus, &port);
    bus.arrived = UINT32_MAX - POSIX_BUS_LISTENERS; /* the count wraps meanwhile */
    open_one = arrive();
    say(open_one, "O\r");
    expect(open_one, "\r", 1);
    for (i = 0; i < 3u * POSIX_BUS_LISTENERS; i++) {
        fd[i] = arrive();
        if (i % 2u == 1u && !is_turned_out(fd[i])) {
            (void)write(fd[i], "S", 1);
            (void)posix_bus_poll(&bus, -1, 100);
        }
    }
    late = arrive();
    say(late, "O\r");
    expect(late, "\r", 1);
    TEST_ASSERT_EQUAL_UINT(2, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    expect(open_one, "T1CFF42018F0F1F2F3F4F5F6F7\r", 27);
    expect(late, "T1CFF42018F0F1F2F3F4F5F6F7\r", 27);
    for (i = 0; i < 3u * POSIX_BUS_LISTENERS; i++) {
        TEST_ASSERT_EQUAL_INT(i < 2u * POSIX_BUS_LISTENERS + 2u, is_turned_out(fd[i])); /* the oldest go first */
        close(fd[i]);
    }
    close(open_one);
    close(late);
    posix_bus_close(&bus);
}

/* Listeners that open their channel and read nothing hold every place: the one furthest behind makes room. */
static void listeners_that_do_not_read_lock_nobody_out(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    int fd[POSIX_BUS_LISTENERS], late;
    unsigned i;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    posix_bus_port(&bus, &port);
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        fd[i] = arrive();
        say(fd[i], "O\r");
    }
    for (i = 0; i < 40000u || posix_bus_room(&bus) > 0u; i++) { /* megabytes: until the kernel's buffers are full too */
        (void)port.send(port.context, &frame);
        if (i % 4096u == 0u) {
            (void)posix_bus_poll(&bus, -1, 0);
        }
    }
    bus.listener[0].tail += 1000u;               /* not quite so far behind, */
    bus.listener[1].tail = bus.listener[1].head; /* and one that keeps up */
    late = arrive();
    TEST_ASSERT_FALSE(is_turned_out(late));
    say(late, "O\r");
    TEST_ASSERT_EQUAL_UINT(POSIX_BUS_LISTENERS, posix_bus_listeners(&bus));
    TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
    expect(late, "\rT1CFF42018F0F1F2F3F4F5F6F7\r", 28);
    TEST_ASSERT_TRUE(bus.listener[0].open && bus.listener[1].open);
    for (i = 0; i < POSIX_BUS_LISTENERS; i++) {
        close(fd[i]);
    }
    close(late);
    posix_bus_close(&bus);
}

static void terminal_serves_one_after_the_other(void)
{
    const aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    unsigned round;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_terminal(&bus));
    posix_bus_port(&bus, &port);
    for (round = 0; round < 3u; round++) {
        const int fd = open(bus.address + 6, O_RDWR | O_NOCTTY);
        TEST_ASSERT_TRUE(fd >= 0);
        say(fd, "C\rO\r");
        TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
        TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
        expect(fd, "\r\rT1CFF42018F0F1F2F3F4F5F6F7\r", 29);
        close(fd); /* without a word */
        (void)posix_bus_poll(&bus, -1, 20);
        (void)posix_bus_poll(&bus, -1, 20);
        TEST_ASSERT_EQUAL_UINT(0, posix_bus_listeners(&bus));
    }
    posix_bus_close(&bus);
}

/* An adapter's driver closes, sets and opens the channel in one go. Where reading stops right behind "close", what
 * waits behind it still counts. */
static void what_waits_behind_a_close_counts(void)
{
    char text[516];
    int fd;
    memset(text, '\r', 510);
    memcpy(text + 510, "C\rO\r", 5);
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_terminal(&bus));
    fd = open(bus.address + 6, O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(fd >= 0);
    say(fd, text);
    TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
    close(fd);
    posix_bus_close(&bus);
}

/* Each thread opens terminals of its own: the address told must be that of the very terminal held. */
static void *open_many_terminals(void *context)
{
    posix_bus_t *own = (posix_bus_t *)context;
    unsigned round, number;
    uintptr_t wrong = 0;
    for (round = 0; round < 100u; round++) {
        char expected[sizeof own->address];
        if (posix_bus_open_terminal(own) != 0) {
            wrong++;
            continue;
        }
        number = UINT_MAX;
        (void)ioctl(own->listener[0].fd, TIOCGPTN, &number);
        (void)snprintf(expected, sizeof expected, "slcan:/dev/pts/%u", number);
        wrong += strcmp(own->address, expected) != 0;
        posix_bus_close(own);
    }
    return (void *)wrong;
}

static void terminals_may_be_opened_by_many_threads(void)
{
    static posix_bus_t own[4];
    pthread_t thread[4];
    void *wrong;
    unsigned i;
    for (i = 0; i < 4u; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_create(&thread[i], NULL, open_many_terminals, &own[i]));
    }
    for (i = 0; i < 4u; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_join(thread[i], &wrong));
        TEST_ASSERT_NULL(wrong);
    }
}

static void endless_commands_are_survived(void)
{
    char noise[1000];
    int fd;
    TEST_ASSERT_EQUAL_INT(0, posix_bus_open_tcp(&bus, 0));
    fd = connect_to_bus();
    memset(noise, 'x', sizeof noise);
    noise[sizeof noise - 1u] = '\0';
    say(fd, noise);
    say(fd, "\rO\r");
    TEST_ASSERT_EQUAL_UINT(1, posix_bus_listeners(&bus));
    close(fd);
    posix_bus_close(&bus);
}

/* ---- template ---------------------------------------------------------------------------------------------------- */

static void template_ring_keeps_order_and_refuses(void)
{
    static aeo_template_t port_template;
    aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    unsigned round, i;
    aeo_template_init(&port_template, &port);
    for (round = 0; round < 5u; round++) {
        for (i = 0; i < AEO_TEMPLATE_RING; i++) {
            frame.data[0] = (uint8_t)i;
            TEST_ASSERT_EQUAL_INT(1, port.send(port.context, &frame));
        }
        TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
        for (i = 0; i < AEO_TEMPLATE_RING; i++) {
            TEST_ASSERT_EQUAL_INT(1, aeo_template_transmit(&port_template, &frame));
            TEST_ASSERT_EQUAL_UINT8(i, frame.data[0]);
        }
        TEST_ASSERT_EQUAL_INT(0, aeo_template_transmit(&port_template, &frame));
    }
    port.lock(port.context);
    port.unlock(port.context);
    TEST_ASSERT_EQUAL_UINT32(0, port.time_us(port.context));
}

/* ---- CAN interfaces ---------------------------------------------------------------------------------------------- */

static void what_cannot_be_opened_is_closed_and_explained(void)
{
    static const char *const names[] = {"", "nosuchcan0", "lo", "a_name_of_16_xxx"};
    char text[SOCKETCAN_TEXT_MAX];
    aeo_can_frame_t frame = make_frame(AEO_CAN_EXTENDED, 8);
    socketcan_t can;
    unsigned i;
    for (i = 0; i < sizeof names / sizeof *names; i++) {
        const int error = socketcan_open(&can, names[i], (int)i % 2);
        TEST_ASSERT_NOT_EQUAL_INT(0, error);
        TEST_ASSERT_EQUAL_INT(-1, can.fd);
        TEST_ASSERT_EQUAL_INT(0, can.up);
        TEST_ASSERT_EQUAL_STRING(text, socketcan_explain(names[i], error, text));
        TEST_ASSERT_NOT_NULL(strstr(text, names[i]));
        socketcan_port(&can, &port, NULL); /* a controller that goes on all the same is refused, not harmed */
        TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
        can.counters.failed = can.counters.down = can.counters.full = UINT32_MAX;
        TEST_ASSERT_EQUAL_INT(0, port.send(port.context, &frame));
        TEST_ASSERT_TRUE((can.counters.failed & can.counters.down & can.counters.full) == UINT32_MAX);
        TEST_ASSERT_EQUAL_INT(0, socketcan_poll(&can));
        socketcan_close(&can);
    }
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, socketcan_open(&can, names[0], 0));
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, socketcan_open(&can, names[3], 0));
}

static void the_lock_is_the_mutex_and_the_clock_runs(void)
{
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    static socketcan_t can;
    uint32_t before_us;
    can.fd = -1;
    socketcan_port(&can, &port, &mutex);
    port.lock(port.context);
    TEST_ASSERT_EQUAL_INT(EBUSY, pthread_mutex_trylock(&mutex));
    port.unlock(port.context);
    TEST_ASSERT_EQUAL_INT(0, pthread_mutex_trylock(&mutex));
    TEST_ASSERT_EQUAL_INT(0, pthread_mutex_unlock(&mutex));
    TEST_ASSERT_EQUAL_INT(0, socketcan_poll(&can)); /* takes it and gives it back */
    TEST_ASSERT_EQUAL_INT(0, pthread_mutex_trylock(&mutex));
    TEST_ASSERT_EQUAL_INT(0, pthread_mutex_unlock(&mutex));
    before_us = port.time_us(port.context);
    (void)usleep(2000);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(2000, port.time_us(port.context) - before_us);
    socketcan_port(&can, &port, NULL);
    TEST_ASSERT_NULL(port.lock);
    TEST_ASSERT_NULL(port.unlock);
}

static void every_reason_has_its_remedy(void)
{
    static const struct {
        int error;
        const char *remedy;
    } reasons[] = {{EAFNOSUPPORT, "modprobe can_raw"},
                   {EPROTONOSUPPORT, "modprobe can_raw"},
                   {EPERM, "CAP_NET_RAW"},
                   {EACCES, "CAP_NET_RAW"},
                   {ENODEV, "ip link add dev can12 type vcan && ip link set can12 up"},
                   {ENOTTY, "ip -brief link"},
                   {EMSGSIZE, "ip link set can12 mtu 72"},
                   {ENETDOWN, "ip link set can12 up"},
                   {ENAMETOOLONG, "1 to 15 characters"},
                   {ENOMEM, "Cannot allocate memory"}};
    char text[SOCKETCAN_TEXT_MAX], longest[400];
    unsigned i;
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1u] = '\0';
    for (i = 0; i < sizeof reasons / sizeof *reasons; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(socketcan_explain("can12", reasons[i].error, text), reasons[i].remedy),
                                     text);
        TEST_ASSERT_NOT_NULL(strstr(text, "can12"));
        TEST_ASSERT_LESS_THAN_size_t(SOCKETCAN_TEXT_MAX, strlen(socketcan_explain(longest, reasons[i].error, text)));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(text_is_that_of_the_adapter);
    RUN_TEST(every_shape_goes_there_and_back);
    RUN_TEST(broken_text_is_no_frame);
    RUN_TEST(listeners_come_and_go);
    RUN_TEST(a_full_ring_refuses);
    RUN_TEST(too_many_listeners_are_turned_away);
    RUN_TEST(silent_peers_lock_nobody_out);
    RUN_TEST(listeners_that_do_not_read_lock_nobody_out);
    RUN_TEST(terminal_serves_one_after_the_other);
    RUN_TEST(what_waits_behind_a_close_counts);
    RUN_TEST(terminals_may_be_opened_by_many_threads);
    RUN_TEST(endless_commands_are_survived);
    RUN_TEST(template_ring_keeps_order_and_refuses);
    RUN_TEST(what_cannot_be_opened_is_closed_and_explained);
    RUN_TEST(the_lock_is_the_mutex_and_the_clock_runs);
    RUN_TEST(every_reason_has_its_remedy);
    return UNITY_END();
}
