#include "fdcan_model.h"

#include <stddef.h>
#include <string.h>

enum { ACCEPT_AFTER = 3, RAM_WORDS = 2560, G4_WORDS = 212, ELEMENT = 18, RECOVERY = 129 };
enum { DBTP = 0x0C, CCCR = 0x18, NBTP = 0x1C, PSR = 0x44, TDCR = 0x48, IR = 0x50, IE = 0x54, ILE = 0x5C, GFC = 0x80 };
enum { TXBC = 0xC0, TXFQS = 0xC4 };
enum { INIT = 1, CCE = 2, ASM = 4, CSA = 8, CSR = 16, FDOE = 0x100, BRSE = 0x200 };
enum { SHUT = 1, OPEN = 0, READ_ONLY = 2 };

/* Registers that exist: bits that may be written, and when. */
typedef struct {
    uint32_t offset, bits;
    int rule;
} entry_t;

static const entry_t common[] = {{DBTP, 0x009F1FFF, SHUT}, {CCCR, 0x0000F3F7, OPEN}, {NBTP, 0xFFFFFF7F, SHUT},
                                 {0x40, 0, READ_ONLY},     {PSR, 0, READ_ONLY},      {TDCR, 0x00007F7F, SHUT},
                                 {0x58, 0x3FFFFFFF, OPEN}, {ILE, 3, OPEN},           {TXFQS, 0, READ_ONLY}};
static const entry_t of_g4[] = {{IR, 0x00FFFFFF, OPEN},   {IE, 0x00FFFFFF, OPEN}, {GFC, 0x0F1F033F, SHUT},
                                {0x84, 0x1FFFFFFF, SHUT}, {0x90, 0, READ_ONLY},   {0x94, 7, OPEN},
                                {TXBC, 0x01000000, SHUT}, {0xC8, 0, READ_ONLY},   {0xCC, 7, OPEN},
                                {0xD0, 7, OPEN},          {0xDC, 7, OPEN},        {0xE0, 7, OPEN}};
static const entry_t of_h7[] = {{IR, 0x3FCFFFFF, OPEN},   {IE, 0x3FCFFFFF, OPEN},   {GFC, 0x0000003F, SHUT},
                                {0x84, 0x00FFFFFC, SHUT}, {0x88, 0x007FFFFC, SHUT}, {0x90, 0x1FFFFFFF, SHUT},
                                {0xA0, 0xFF7FFFFC, SHUT}, {0xA4, 0, READ_ONLY},     {0xA8, 0x3F, OPEN},
                                {0xAC, 0x0000FFFC, SHUT}, {0xB0, 0xFF7FFFFC, SHUT}, {0xBC, 0x00000777, SHUT},
                                {TXBC, 0x7F3FFFFC, SHUT}, {0xC8, 7, SHUT},          {0xCC, 0, READ_ONLY},
                                {0xD0, 0xFFFFFFFF, OPEN}, {0xE0, 0xFFFFFFFF, OPEN}, {0xF0, 0x3F3FFFFC, SHUT}};
static const uint8_t bytes_of[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static struct {
    uintptr_t registers, memory; /* of the instance */
    uint32_t value[0x104 / 4], ram[RAM_WORDS];
    uint8_t written[RAM_WORDS],
        fresh[32]; /* words written once; elements whose header was written since the last request */
    uint32_t pending, put, get, rx_put, rx_get, rx_level, wanted;
    unsigned accept_in, recessive;
    int h7, frozen, masked, off;
    const char *broken;
    void (*urgent)(void);
} m;

static void blame(int holds, const char *what)
{
    if (!holds && m.broken == NULL) {
        m.broken = what;
    }
}

/* ---- what the registers say of the memory ------------------------------------------------------------------------ */

static uint32_t tx_count(void)
{
    return m.h7 ? (m.value[TXBC / 4] >> 24) & 0x3F : 3;
}

static uint32_t rx_count(void)
{
    return m.h7 ? (m.value[0xA0 / 4] >> 16) & 0x7F : 3;
}

/* Word of the memory, counted from its start (G4: the instance's), where a list begins. */
static uint32_t place(uint32_t g4_byte, uint32_t h7_register)
{
    return (m.h7 ? m.value[h7_register / 4] & 0xFFFC : g4_byte) / 4;
}

static uint32_t bit(uint32_t g4, uint32_t h7)
{
    return UINT32_C(1) << (m.h7 ? h7 : g4);
}

static const entry_t *find(uint32_t offset)
{
    const entry_t *more = m.h7 ? of_h7 : of_g4;
    const size_t count = m.h7 ? sizeof of_h7 / sizeof *of_h7 : sizeof of_g4 / sizeof *of_g4;
    for (size_t i = 0; i < sizeof common / sizeof *common; i++) {
        if (common[i].offset == offset) {
            return &common[i];
        }
    }
    for (size_t i = 0; i < count; i++) {
        if (more[i].offset == offset) {
            return &more[i];
        }
    }
    blame(0, "a register that this family does not have");
    return NULL;
}

/* ---- memory ------------------------------------------------------------------------------------------------------ */

/* Return the word's number within the memory, or RAM_WORDS when it is outside the instance. */
static uint32_t word_at(uintptr_t address)
{
    const uintptr_t start = m.h7 ? 0x4000AC00 : m.memory, limit = m.h7 ? RAM_WORDS : G4_WORDS;
    if (address % 4 != 0 || address < m.memory || (address - start) / 4 >= limit) {
        blame(0, "message RAM outside the instance, or part of a word");
        return RAM_WORDS;
    }
    return (uint32_t)((address - start) / 4);
}

/* Return the element that holds a word of a FIFO, or count when none does. */
static uint32_t element_of(uint32_t word, uint32_t first, uint32_t count)
{
    return word < first || word >= first + ELEMENT * count ? count : (word - first) / ELEMENT;
}

static void write_memory(uintptr_t address, uint32_t value)
{
    const uint32_t word = word_at(address), first = place(0x278, TXBC);
    if (word == RAM_WORDS) {
        return;
    }
    m.ram[word] = value;
    m.written[word] = 1;
    if ((m.value[CCCR / 4] & CCE) == 0) {
        const uint32_t element = element_of(word, first, tx_count());
        blame(element < tx_count(), "a word written after set-up that is in no TX element");
        if (element < tx_count()) {
            blame((m.pending >> element & 1) == 0, "an element written while it is being sent");
            m.fresh[element] |= (uint8_t)(1 << ((word - first) % ELEMENT < 2 ? (word - first) % ELEMENT : 2));
        }
    }
}

static uint32_t read_memory(uintptr_t address)
{
    const uint32_t word = word_at(address);
    if (word == RAM_WORDS) {
        return 0;
    }
    blame(m.written[word], "a word read that was never written");
    blame(m.rx_level > 0 && element_of(word, place(0xB0, 0xA0), rx_count()) == m.rx_get,
          "a word read that is not of the oldest frame");
    return m.ram[word];
}

/* ---- registers --------------------------------------------------------------------------------------------------- */

static void forget_fifos(void)
{
    m.pending = m.put = m.get = m.rx_put = m.rx_get = m.rx_level = 0;
    memset(m.fresh, 0, sizeof m.fresh);
}

/* Writes to INIT cross into the other clock domain; everything else of CCCR acts at once. */
static void write_control(uint32_t value)
{
    const uint32_t now = m.value[CCCR / 4];
    const int opens = (now & INIT) != 0 && (value & INIT) != 0;
    blame(m.accept_in == 0 || (value & INIT) == m.wanted, "INIT written before the value before was accepted");
    blame((value & CCE) == 0 || opens, "CCE set before INIT reads 1");
    blame((now & CCE) != 0 || ((now ^ value) & 0xF340) == 0, "a mode changed without CCE");
    blame((now & CCE) != 0 || (value & ~now & 0xA4) == 0, "a test or monitoring mode set without CCE");
    m.value[CCCR / 4] = (now & (INIT | CSA)) | (value & ~(uint32_t)(INIT | CSA | CCE));
    if (opens && (value & CCE) != 0) {
        m.value[CCCR / 4] |= CCE;
        forget_fifos();
    }
    if ((value & INIT) != m.wanted) {
        m.wanted = value & INIT;
        m.accept_in = ACCEPT_AFTER;
    }
}

static uint32_t read_control(void)
{
    if (m.frozen) {
        return m.value[CCCR / 4];
    }
    if (m.accept_in > 0 && --m.accept_in == 0) {
        m.value[CCCR / 4] = (m.value[CCCR / 4] & ~(uint32_t)INIT) | m.wanted;
        if (m.wanted == 0) {
            m.value[CCCR / 4] &= ~(uint32_t)CCE;
        }
    }
    if ((m.value[CCCR / 4] & CSR) == 0) {
        m.value[CCCR / 4] &= ~(uint32_t)CSA;
    }
    return m.value[CCCR / 4];
}

static void add_request(uint32_t value)
{
    blame((m.value[CCCR / 4] & CCE) == 0, "a transmission requested with CCE set");
    blame(m.masked, "a transmission requested with interrupts let in");
    blame(m.put < tx_count() && value == UINT32_C(1) << m.put,
          "a transmission requested elsewhere than at the put index");
    blame((m.pending & value) == 0, "a transmission requested twice");
    if (m.put < tx_count()) {
        blame((m.fresh[m.put] & 3) == 3, "a transmission requested of an element without its header");
        m.fresh[m.put] = 0;
        m.pending |= value;
        m.put = (m.put + 1) % tx_count();
    }
}

static void write_register(uint32_t offset, uint32_t value)
{
    const entry_t *entry = find(offset);
    if (entry == NULL) {
        return;
    }
    blame(entry->rule != READ_ONLY, "a register written that can only be read");
    blame((value & ~(entry->bits | (offset == CCCR ? CSA : 0))) == 0, "a reserved bit set");
    if (entry->rule == SHUT && (m.value[CCCR / 4] & (INIT | CCE)) != (INIT | CCE)) {
        blame(0, "a protected register written without INIT and CCE");
        return;
    }
    if (offset == CCCR) {
        write_control(value);
    } else if (offset == IR) {
        m.value[IR / 4] &= ~value;
    } else if (offset == (m.h7 ? 0xD0u : 0xCCu)) {
        add_request(value);
    } else if (offset == (m.h7 ? 0xA8u : 0x94u)) {
        blame(m.rx_level > 0 && value == m.rx_get, "a frame acknowledged that is not the oldest");
        m.rx_get = (value + 1) % rx_count();
        m.rx_level -= m.rx_level > 0 ? 1 : 0;
    } else {
        m.value[offset / 4] = value;
    }
}

static uint32_t read_register(uint32_t offset)
{
    uint32_t pending = 0, i;
    if (find(offset) == NULL) {
        return 0;
    }
    if (offset == TXFQS) {
        for (i = 0; i < 32; i++) {
            pending += m.pending >> i & 1;
        }
        return (tx_count() - pending) | m.get << 8 | m.put << 16 | (pending == tx_count() ? UINT32_C(1) << 21 : 0);
    }
    if (offset == (m.h7 ? 0xA4u : 0x90u)) {
        return m.rx_level | m.rx_get << 8 | m.rx_put << 16 | (m.rx_level == rx_count() ? UINT32_C(1) << 24 : 0);
    }
    return offset == CCCR ? read_control() : m.value[offset / 4];
}

uint32_t fdcan_model_read(uintptr_t address)
{
    return address >= m.registers && address < m.registers + 0x104 ? read_register((uint32_t)(address - m.registers))
                                                                   : read_memory(address);
}

void fdcan_model_write(uintptr_t address, uint32_t value)
{
    if (address >= m.registers && address < m.registers + 0x104) {
        write_register((uint32_t)(address - m.registers), value);
    } else {
        write_memory(address, value);
    }
}

uint32_t fdcan_model_mask(void)
{
    const uint32_t before = (uint32_t)m.masked;
    m.masked = 1;
    return before;
}

void fdcan_model_unmask(uint32_t before)
{
    blame(m.masked, "interrupts let in twice");
    m.masked = (int)before;
    if (!m.masked && m.urgent != NULL) {
        void (*urgent)(void) = m.urgent;
        m.urgent = NULL;
        urgent();
    }
}

void fdcan_model_interrupt_next(void (*urgent)(void))
{
    m.urgent = urgent;
}

/* ---- what a test does -------------------------------------------------------------------------------------------- */

void fdcan_model_start(int h7, uintptr_t registers, uintptr_t memory)
{
    memset(&m, 0, sizeof m);
    m.h7 = h7;
    m.registers = registers;
    m.memory = memory;
    m.value[CCCR / 4] = m.wanted = INIT;
    m.value[IR / 4] = bit(0, 0);
    m.value[PSR / 4] = 0x707;
    m.value[(h7 ? 0x90 : 0x84) / 4] = 0x1FFFFFFF;
    for (uint32_t i = 0; i < RAM_WORDS; i++) {
        m.ram[i] = UINT32_C(0xA5A5A5A5) * (i + 1);
    }
}

const char *fdcan_model_broken(void)
{
    return m.broken;
}

void fdcan_model_freeze(void)
{
    m.frozen = 1;
    m.value[CCCR / 4] = m.wanted = 0;
}

void fdcan_model_sleep(void)
{
    m.value[CCCR / 4] |= CSA | CSR;
}

static int is_on_bus(void)
{
    (void)read_control();
    return (m.value[CCCR / 4] & (INIT | ASM | CSR)) == 0 && !m.off;
}

int fdcan_model_transmit(aeo_can_frame_t *frame)
{
    const uint32_t *element = &m.ram[place(0x278, TXBC) + ELEMENT * m.get], control = m.value[CCCR / 4];
    const uint32_t code = element[1] >> 16 & 15, fd = element[1] >> 21 & 1, fast = element[1] >> 20 & 1;
    if (!is_on_bus() || (m.pending >> m.get & 1) == 0) {
        return 0;
    }
    blame((element[0] & 0xA0000000) == 0 && (element[1] & 0xFFC0FFFF) == 0,
          "a header with bits that mean something else");
    blame(fd == 0 || (control & FDOE) != 0, "CAN FD without FDOE");
    blame(fast == 0 || (fd != 0 && (control & BRSE) != 0), "a fast data phase without BRSE or CAN FD");
    blame(fd != 0 || code <= 8, "a classic frame with a length above 8");
    blame(!m.h7 || m.value[0xC8 / 4] == 7, "elements too small for 64 bytes");
    memset(frame, 0, sizeof *frame);
    frame->flags = (uint8_t)((element[0] >> 30 & 1) | fd << 1 | fast << 2);
    frame->id = (element[0] >> 30 & 1) != 0 ? element[0] & 0x1FFFFFFF : element[0] >> 18 & 0x7FF;
    frame->length = bytes_of[code];
    for (uint32_t i = 0; i < frame->length; i++) {
        frame->data[i] = (uint8_t)(element[2 + i / 4] >> 8 * (i % 4));
    }
    m.pending &= ~(UINT32_C(1) << m.get);
    if ((m.value[(m.h7 ? 0xE0 : 0xDC) / 4] >> m.get & 1) != 0) {
        m.value[IR / 4] |= bit(7, 9);
    }
    m.get = (m.get + 1) % tx_count();
    return 1;
}

/* Filters in the order of their list; the first that fits decides. Only what a port uses: identifier with mask. */
static int passes(uint32_t id, int extended)
{
    const uint32_t lists = m.h7 ? 0 : m.value[GFC / 4];
    const uint32_t count = extended ? (m.h7 ? m.value[0x88 / 4] >> 16 & 0x7F : lists >> 24 & 15)
                                    : (m.h7 ? m.value[0x84 / 4] >> 16 & 0xFF : lists >> 16 & 31);
    for (uint32_t i = 0; i < count; i++) {
        if (extended) {
            const uint32_t *element = &m.ram[place(0x70, 0x88) + 2 * i];
            blame(element[0] >> 29 == 1 && element[1] >> 30 == 2, "a filter that is not identifier and mask");
            if (((id ^ element[0]) & element[1] & 0x1FFFFFFF) == 0) {
                return 1;
            }
        } else {
            const uint32_t element = m.ram[place(0, 0x84) + i];
            blame(element >> 30 == 2 && (element >> 27 & 7) == 1, "a filter that is not identifier and mask");
            if (((id ^ element >> 16) & element & 0x7FF) == 0) {
                return 1;
            }
        }
    }
    return (m.value[GFC / 4] >> (extended ? 2 : 4) & 2) == 0;
}

int fdcan_model_arrive(const aeo_can_frame_t *frame, unsigned code, int remote)
{
    const int extended = (frame->flags & AEO_CAN_EXTENDED) != 0;
    uint32_t *element = &m.ram[place(0xB0, 0xA0) + ELEMENT * m.rx_put];
    if (!is_on_bus() || (remote && (m.value[GFC / 4] & (extended ? 1 : 2)) != 0) || !passes(frame->id, extended)) {
        return 0;
    }
    if (m.rx_level == rx_count()) {
        m.value[IR / 4] |= bit(2, 3);
        return 0;
    }
    element[0] = extended ? UINT32_C(1) << 30 | frame->id : frame->id << 18;
    element[1] =
        0x1234 | code << 16 | (uint32_t)(frame->flags >> 1 & 1) << 21 | (uint32_t)(frame->flags >> 2 & 1) << 20;
    memset(element + 2, 0, 64);
    for (uint32_t i = 0; i < frame->length; i++) {
        element[2 + i / 4] |= (uint32_t)frame->data[i] << 8 * (i % 4);
    }
    m.rx_put = (m.rx_put + 1) % rx_count();
    m.rx_level++;
    m.value[IR / 4] |= bit(0, 0);
    return 1;
}

void fdcan_model_become_passive(void)
{
    m.value[PSR / 4] |= 0x60;
    m.value[IR / 4] |= bit(17, 23) | bit(18, 24);
}

void fdcan_model_become_bus_off(void)
{
    m.value[PSR / 4] |= 0xE0;
    m.value[CCCR / 4] |= m.wanted = INIT;
    m.value[IR / 4] |= bit(19, 25);
    m.recessive = 0;
    m.off = 1;
}

void fdcan_model_fail_memory(void)
{
    m.value[CCCR / 4] |= ASM;
    m.value[IR / 4] |= bit(14, 17);
}

void fdcan_model_idle(unsigned times)
{
    for (unsigned i = 0; i < ACCEPT_AFTER; i++) {
        (void)read_control();
    }
    if (!m.off || (m.value[CCCR / 4] & INIT) != 0) {
        return;
    }
    m.recessive += times;
    if (m.recessive >= RECOVERY) {
        m.off = 0;
        m.value[PSR / 4] &= ~UINT32_C(0xE0);
        m.value[IR / 4] |= bit(19, 25) | bit(17, 23);
    }
}

int fdcan_model_interrupts(void)
{
    return (m.value[IR / 4] & m.value[IE / 4]) != 0 && (m.value[ILE / 4] & 1) != 0 && !m.masked;
}

uint32_t fdcan_model_register(uint32_t offset)
{
    return m.value[offset / 4];
}

int fdcan_model_is_masked(void)
{
    return m.masked;
}
