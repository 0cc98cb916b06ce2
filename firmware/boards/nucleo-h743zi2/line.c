/* The serial line: USART3, which the debugger passes on to USB (PD8 sends, PD9 receives). The DMA fills a ring with what comes, and sends
 * what was handed over. */

#include <string.h>

#include "board.h"
#include "chip.h"
#include "registers.h"

#define KERNEL_HZ 120000000u /* APB1 */

enum { DMAMUX_USART3_RX = 45, DMAMUX_USART3_TX = 46, RECEIVES = 1, SENDS = 2, USART = 7 };
enum { RING = 8192, AT_A_TIME = 2048 }; /* bytes; the ring holds 27 ms at 3 Mbaud */

static volatile uint8_t ring[RING] FOR_DMA;
static uint8_t sending[AT_A_TIME] FOR_DMA;
static uint32_t taken; /* place in the ring */

void line_begin(uint32_t baud)
{
    RCC_AHB4ENR |= BIT(3);
    RCC_APB1LENR |= BIT(18);
    (void)RCC_APB1LENR;
    FIELD(GPIO('D', GPIO_AFRH), 0xFF, 0, USART << 4 | USART);
    FIELD(GPIO('D', GPIO_MODER), 0xF, 2 * 8, 0xA); /* alternate function */
    FIELD(GPIO('D', GPIO_PUPDR), 3, 2 * 9, 1);     /* an open line is idle */
    USART3_BRR = (KERNEL_HZ + baud / 2) / baud;
    USART3_CR3 = BIT(12) | BIT(7) | BIT(6);          /* OVRDIS, DMAT, DMAR */
    USART3_CR1 = BIT(29) | BIT(3) | BIT(2) | BIT(0); /* FIFOEN, TE, RE, UE */
    DMAMUX1(RECEIVES) = DMAMUX_USART3_RX;
    DMAMUX1(SENDS) = DMAMUX_USART3_TX;
    DMA1_STREAM(RECEIVES, DMA_PAR) = USART3_RDR;
    DMA1_STREAM(RECEIVES, DMA_M0AR) = (uint32_t)(uintptr_t)ring;
    DMA1_STREAM(RECEIVES, DMA_NDTR) = RING;
    DMA1_STREAM(RECEIVES, DMA_CR) = 2u << 16 | BIT(20) | BIT(10) | BIT(8) | BIT(0); /* PL, TRBUFF, MINC, CIRC, EN */
    DMA1_STREAM(SENDS, DMA_PAR) = USART3_TDR;
    DMA1_STREAM(SENDS, DMA_M0AR) = (uint32_t)(uintptr_t)sending;
}

size_t board_read(uint8_t *bytes, size_t room)
{
    const uint32_t written = (RING - DMA1_STREAM(RECEIVES, DMA_NDTR)) % RING;
    size_t n = 0;
    for (; n < room && taken != written; taken = (taken + 1) % RING)
        bytes[n++] = ring[taken];
    return n;
}

/* Nothing while the bytes before are on their way. */
size_t board_write(const uint8_t *bytes, size_t n)
{
    if (n == 0 || DMA1_STREAM(SENDS, DMA_CR) & BIT(0))
        return 0;
    if (n > AT_A_TIME)
        n = AT_A_TIME;
    memcpy(sending, bytes, n);
    __asm__ volatile("dsb" ::: "memory");
    DMA1_LIFCR = 0x3Du << 16;
    DMA1_STREAM(SENDS, DMA_NDTR) = (uint32_t)n;
    DMA1_STREAM(SENDS, DMA_CR) = BIT(20) | BIT(10) | 1u << 6 | BIT(0); /* TRBUFF, MINC, DIR: from memory, EN */
    return n;
}

#ifndef NUCLEO_CAN
bool board_receive_frame(struct vl_frame *frame)
{
    (void)frame;
    return false; /* the bus is not used */
}

bool board_send_frame(const struct vl_frame *frame)
{
    (void)frame;
    return false;
}
#endif
