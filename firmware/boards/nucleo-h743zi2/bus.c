/* The CAN FD bus: FDCAN1 at 1 Mbit/s, data at 5 Mbit/s, for a transceiver (PD1 sends, PD0 receives). In make nucleo-h743zi2-can alone;
 * elsewhere the serial line is used. Nothing here has run on silicon. */

#include "board.h"
#include "chip.h"
#include "registers.h"

#ifdef NUCLEO_CAN

#define WAIT_UNTIL(condition) while (!(condition)) {}

enum { FROM_PLL1_Q = 1, FDCAN = 9 };                 /* 80 MHz (clock.c); function of the pins */
enum { INIT = 1, CCE = 2, FDOE = 256, BRSE = 512 };  /* of CCCR */
/* 80 MHz / 80 in a bit, sampled at 80 %; and / 16, sampled at 75 %, where the delay of the transceiver is measured in every frame. */
enum { BEFORE = 63, AFTER = 16, DATA_BEFORE = 11, DATA_AFTER = 4 };
/* Words of the memory for messages: two filters, then what comes, then what is sent; an element has two words of head and 64 bytes. */
enum { FILTERS_AT = 0, N_FILTERS = 2, FIFO_AT = 16, N_FIFO = 64, ELEMENT = 18, SENT_AT = FIFO_AT + N_FIFO * ELEMENT, N_SENT = 32 };
enum { MEMORY_WORDS = 2560, ANY_NODE = 0x7F0, NODE = 0x00F, CLASSIC = 2, TO_FIFO_0 = 1, OF_64_BYTES = 7 };
_Static_assert((int)SENT_AT + N_SENT * ELEMENT <= (int)MEMORY_WORDS, "the memory for messages is too small");

static const uint8_t LENGTHS[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static uint32_t filter(uint32_t identifier, uint32_t mask)
{
    return (uint32_t)CLASSIC << 30 | (uint32_t)TO_FIFO_0 << 27 | identifier << 16 | mask;
}

static void begin_pins(void)
{
    RCC_AHB4ENR |= BIT(3);
    (void)RCC_AHB4ENR;
    FIELD(GPIO('D', GPIO_AFRL), 0xFF, 0, FDCAN << 4 | FDCAN);
    FIELD(GPIO('D', GPIO_OSPEEDR), 3, 2 * 1, 1);
    FIELD(GPIO('D', GPIO_PUPDR), 3, 2 * 0, 1); /* an open bus is idle */
    FIELD(GPIO('D', GPIO_MODER), 0xF, 0, 0xA); /* alternate function */
}

static void begin_memory(uint8_t node)
{
    for (uint32_t i = 0; i < MEMORY_WORDS; i++)
        FDCAN_MEMORY[i] = 0;
    FDCAN_MEMORY[FILTERS_AT] = filter(0, ANY_NODE | NODE); /* the emergency stop of all nodes */
    FDCAN_MEMORY[FILTERS_AT + 1] = filter(node, NODE);
    FDCAN1_GFC = 2u << 4 | 2u << 2 | BIT(1) | BIT(0); /* ANFS, ANFE, RRFS, RRFE: nothing else, no 29 bits, no remote frames */
    FDCAN1_SIDFC = (uint32_t)N_FILTERS << 16 | (uint32_t)FILTERS_AT << 2;
    FDCAN1_XIDFC = 0;
    FDCAN1_RXF0C = (uint32_t)N_FIFO << 16 | (uint32_t)FIFO_AT << 2;
    FDCAN1_RXESC = OF_64_BYTES;
    FDCAN1_TXBC = (uint32_t)N_SENT << 24 | (uint32_t)SENT_AT << 2; /* a FIFO */
    FDCAN1_TXESC = OF_64_BYTES;
}

void bus_begin(uint8_t node)
{
    begin_pins();
    FIELD(RCC_D2CCIP1R, 3, 28, FROM_PLL1_Q);
    RCC_APB1HENR |= BIT(8);
    (void)RCC_APB1HENR;
    FDCAN1_CCCR = INIT;
    WAIT_UNTIL(FDCAN1_CCCR & INIT)
    FDCAN1_CCCR = INIT | CCE;
    FDCAN1_CCCR = INIT | CCE | FDOE | BRSE;
    FDCAN1_NBTP = (uint32_t)(AFTER - 1) << 25 | (uint32_t)(BEFORE - 1) << 8 | (AFTER - 1);
    FDCAN1_DBTP = BIT(23) | (uint32_t)(DATA_BEFORE - 1) << 8 | (uint32_t)(DATA_AFTER - 1) << 4 | (DATA_AFTER - 1); /* TDC */
    FDCAN1_TDCR = (uint32_t)(DATA_BEFORE + 1) << 8;
    begin_memory(node);
    FDCAN1_CCCR = FDOE | BRSE; /* after bus-off the controller sets INIT, and stays silent until a reset */
}

bool board_receive_frame(struct vl_frame *frame)
{
    const uint32_t status = FDCAN1_RXF0S;
    if ((status & 0x7F) == 0)
        return false;
    const uint32_t place = status >> 8 & 0x3F;
    const volatile uint32_t *const element = FDCAN_MEMORY + FIFO_AT + place * ELEMENT;
    frame->identifier = (uint16_t)(element[0] >> 18 & 0x7FF);
    frame->length = LENGTHS[element[1] >> 16 & 15];
    frame->fd = element[1] & BIT(21);
    for (uint32_t i = 0; i < sizeof frame->data; i += 4) {
        const uint32_t word = element[2 + i / 4];
        for (uint32_t k = 0; k < 4; k++)
            frame->data[i + k] = (uint8_t)(word >> 8 * k);
    }
    FDCAN1_RXF0A = place;
    return true;
}

bool board_send_frame(const struct vl_frame *frame)
{
    const uint32_t status = FDCAN1_TXFQS;
    uint32_t code = 0;
    if (status & BIT(21)) /* TFQF */
        return false;
    while (LENGTHS[code] < frame->length)
        code++;
    const uint32_t place = status >> 16 & 0x1F;
    volatile uint32_t *const element = FDCAN_MEMORY + SENT_AT + place * ELEMENT;
    element[0] = (uint32_t)frame->identifier << 18;
    element[1] = code << 16 | (frame->fd ? BIT(21) | BIT(20) : 0); /* FDF, BRS */
    for (uint32_t i = 0; i < frame->length; i += 4)
        element[2 + i / 4] = (uint32_t)frame->data[i] | (uint32_t)frame->data[i + 1] << 8 | (uint32_t)frame->data[i + 2] << 16
                             | (uint32_t)frame->data[i + 3] << 24;
    __asm__ volatile("dsb" ::: "memory");
    FDCAN1_TXBAR = BIT(place);
    return true;
}

#endif
