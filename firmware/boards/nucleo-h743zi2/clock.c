/* 480 MHz from the 8 MHz that the debugger puts on the crystal's pin, and microseconds. */

#include "board.h"
#include "chip.h"
#include "registers.h"

#define WAIT_UNTIL(condition) while (!(condition)) {}

enum { FROM_PLL1 = 3, FROM_HSE = 2, SCALE_1 = 3 };
enum { OF_2_MHZ = 4, TIMES_480 = 480, BY_2 = 2, BY_12 = 12 }; /* 8 MHz / 4 x 480 / 2; and / 12 = 80 MHz, for the bus */
enum { HALF_HPRE = 8, HALF_PPRE = 4 };              /* codes of RCC for a half: buses at 240 MHz, peripherals at 120 MHz */

/* The core's voltage for 480 MHz (scale 0, RM0433 6.8.6): scale 1, then the overdrive. Chips of revision V only. */
static void begin_power(void)
{
    PWR_CR3 = BIT(2) | BIT(1); /* SCUEN, LDOEN: the reset's values, and by this they are taken */
    FIELD(PWR_D3CR, 3, 14, SCALE_1);
    WAIT_UNTIL(PWR_D3CR & BIT(13))
    RCC_APB4ENR |= BIT(1); /* SYSCFG */
    (void)RCC_APB4ENR;
    SYSCFG_PWRCR |= BIT(0); /* ODEN */
    WAIT_UNTIL(PWR_D3CR & BIT(13))
}

/* The timer of microseconds: TIM5 has 32 bits and runs at 240 MHz. */
static void begin_microseconds(void)
{
    RCC_APB1LENR |= BIT(3);
    (void)RCC_APB1LENR;
    TIM5_PSC = 240 - 1;
    TIM5_ARR = UINT32_MAX;
    TIM5_EGR = BIT(0);
    TIM5_CR1 = BIT(0);
}

void clock_begin(void)
{
    begin_power();
    FLASH_ACR = 2u << 4 | 4; /* WRHIGHFREQ, LATENCY: RM0433 table 17, 240 MHz at scale 0 */
    WAIT_UNTIL((FLASH_ACR & 15u) == 4)
    RCC_CR |= BIT(18) | BIT(16); /* HSEBYP, HSEON */
    WAIT_UNTIL(RCC_CR & BIT(17))
    RCC_PLLCKSELR = OF_2_MHZ << 4 | FROM_HSE;
    RCC_PLLCFGR = BIT(17) | BIT(16) | 1u << 2; /* DIVQ1EN, DIVP1EN; PLL1RGE: 2 to 4 MHz come in; PLL1VCOSEL 0: 192 to 960 MHz come out */
    RCC_PLL1DIVR = 1u << 24 | (BY_12 - 1) << 16 | (BY_2 - 1) << 9 | (TIMES_480 - 1);
    RCC_CR |= BIT(24);
    WAIT_UNTIL(RCC_CR & BIT(25))
    RCC_D1CFGR = HALF_PPRE << 4 | HALF_HPRE;
    RCC_D2CFGR = HALF_PPRE << 8 | HALF_PPRE << 4;
    RCC_D3CFGR = HALF_PPRE << 4;
    FIELD(RCC_CFGR, 7, 0, FROM_PLL1);
    WAIT_UNTIL((RCC_CFGR >> 3 & 7u) == FROM_PLL1)
    begin_microseconds();
}

/* To be called within 71 minutes again, when the timer begins anew; the main loop does so every millisecond. */
uint64_t board_clock_us(void)
{
    static uint32_t before, turns;
    uint32_t masked;
    __asm__ volatile("mrs %0, primask\n cpsid i" : "=r"(masked)::"memory");
    const uint32_t now = TIM5_CNT;
    turns += now < before;
    before = now;
    const uint64_t us = (uint64_t)turns << 32 | now;
    __asm__ volatile("msr primask, %0" ::"r"(masked) : "memory");
    return us;
}

/* A number that differs from reset to reset: the generator of random numbers runs on the clock of 48 MHz. */
uint32_t clock_random(void)
{
    RCC_CR |= BIT(12); /* HSI48ON */
    WAIT_UNTIL(RCC_CR & BIT(13))
    RCC_AHB2ENR |= BIT(6);
    (void)RCC_AHB2ENR;
    RNG_CR = BIT(2);
    WAIT_UNTIL(RNG_SR & BIT(0))
    return RNG_DR;
}

/* The chip's watchdog: 32 kHz / 8 / 100, 25 ms. It cannot be switched off again. */
void clock_begin_watchdog(void)
{
    IWDG1_KR = 0xCCCC;
    IWDG1_KR = 0x5555;
    IWDG1_PR = 1;
    IWDG1_RLR = 100;
    WAIT_UNTIL(IWDG1_SR == 0)
    IWDG1_KR = 0xAAAA;
}

void board_feed_watchdog(void)
{
    IWDG1_KR = 0xAAAA;
}
