/* Converters: timer 6 triggers the output (DAC1, PA4) and the inputs (ADC1, four channels one after the other) at once. The DMA
 * collects the four counts and interrupts; the output of the next instant is handed over then, so that it goes out with the next
 * trigger, whenever the interrupt ran.
 *
 * Inputs on the Zio connector: A0 PA3 (channel 15), A1 PC0 (10), A2 PC3 (13), A3 PB1 (5); the output is on D24, PA4. UM2407, table
 * of the NUCLEO-H743ZI2. */

#include "board.h"
#include "chip.h"
#include "registers.h"
#include "vibrolock.h"

#define WAIT_UNTIL(condition) while (!(condition)) {}
#define TIMER_HZ 48000000u /* 240 MHz / 5: 16 bits reach down to 733 Hz */
#define LEAST_TICKS 2400u  /* 20 kHz */
#define MIDDLE 2048        /* of the output converter: 0 V behind the front end */
#define MIDDLE_IN 32767    /* of the input converters, whose front end turns the sign */
#define LAST 65535         /* their ends, which are beyond the range */

enum { TIM6_TRIGGERS_ADC = 13, TIM6_TRIGGERS_DAC = 5, DMAMUX_ADC1 = 9, DMA1_STREAM0_IRQ = 11 };
#define TRIGGERED (BIT(1)) /* TEN1 */

static volatile uint16_t counts_in[N_CHANNELS] FOR_DMA;
static uint64_t began_us, done; /* when sampling began, and instants since then */
static uint32_t rate;           /* mHz */

/* Analog mode, the reset's state, but for the button. */
static void begin_pins(void)
{
    RCC_AHB4ENR |= BIT(0) | BIT(1) | BIT(2) | BIT(6); /* A, B, C, G */
    (void)RCC_AHB4ENR;
    FIELD(GPIO('G', GPIO_MODER), 3, 2 * 14, 0); /* D2, PG14: the emergency stop, a contact to ground that opens */
    FIELD(GPIO('G', GPIO_PUPDR), 3, 2 * 14, 1);
}

static void begin_output(void)
{
    RCC_APB1LENR |= BIT(29);
    (void)RCC_APB1LENR;
    DAC1_DHR12R1 = MIDDLE;
    DAC1_CR = TIM6_TRIGGERS_DAC << 2 | BIT(0); /* TSEL1, EN1; not triggered: what is written goes out at once */
}

/* 64 MHz (HSI) / 2, and by 2 once more in chips of revision V: 16 MHz (RM0433 25.4.3). */
static void begin_inputs(void)
{
    RCC_AHB1ENR |= BIT(5) | BIT(0); /* ADC12, DMA1 */
    (void)RCC_AHB1ENR;
    FIELD(RCC_D3CCIPR, 3, 16, 2); /* ADCSEL: per_ck, which is HSI after a reset */
    ADC12_CCR = 1u << 18;         /* PRESC: 2; CKMODE: asynchronous */
    ADC1_CR = 0;                  /* out of deep power down */
    ADC1_CR = BIT(28) | 2u << 8;  /* ADVREGEN; BOOST: 12.5 to 25 MHz */
    WAIT_UNTIL(ADC1_ISR & BIT(12)) /* LDORDY */
    ADC1_CR |= BIT(31) | BIT(16); /* ADCAL with ADCALLIN: offset and linearity */
    WAIT_UNTIL(!(ADC1_CR & BIT(31)))
    ADC1_ISR = BIT(0);
    ADC1_CR |= BIT(0);
    WAIT_UNTIL(ADC1_ISR & BIT(0))
    ADC1_PCSEL = BIT(15) | BIT(10) | BIT(13) | BIT(5);
    ADC1_SMPR1 = 3u << (3 * 5);                                               /* 16.5 cycles, and 8.5 for 16 bits */
    ADC1_SMPR2 = 3u << (3 * (15 - 10)) | 3u << (3 * (10 - 10)) | 3u << (3 * (13 - 10));
    ADC1_SQR1 = 5u << 24 | 13u << 18 | 10u << 12 | 15u << 6 | (N_CHANNELS - 1);
    ADC1_CFGR = BIT(12) | 1u << 10 | TIM6_TRIGGERS_ADC << 5 | 3u; /* OVRMOD; rising edge; EXTSEL; DMNGT: circular DMA */
    DMAMUX1(0) = DMAMUX_ADC1;
    DMA1_STREAM(0, DMA_PAR) = ADC1_DR;
    DMA1_STREAM(0, DMA_M0AR) = (uint32_t)(uintptr_t)counts_in;
    NVIC_IPR(DMA1_STREAM0_IRQ) = 0x10; /* above all others */
    NVIC_ISER0 = BIT(DMA1_STREAM0_IRQ);
}

void converters_begin(void)
{
    begin_pins();
    begin_output();
    begin_inputs();
    RCC_APB1LENR |= BIT(4); /* timer 6 */
    (void)RCC_APB1LENR;
    TIM6_PSC = 240000000u / TIMER_HZ - 1;
}

void converters_to_middle(void)
{
    RCC_APB1LENR |= BIT(29); /* a fault may come before `begin_output` */
    (void)RCC_APB1LENR;
    DAC1_CR &= ~TRIGGERED;
    DAC1_DHR12R1 = MIDDLE;
}

/* -- what the core asks for ------------------------------------------------------------------------------------------------ */

static uint32_t divider(uint32_t rate_mhz)
{
    const uint64_t ticks = (1000ull * TIMER_HZ + rate_mhz / 2) / rate_mhz;
    return ticks > 65536 ? 65536 : ticks < LEAST_TICKS ? LEAST_TICKS : (uint32_t)ticks;
}

uint32_t board_nearest_rate_mhz(uint32_t rate_mhz)
{
    const uint32_t by = divider(rate_mhz);
    return (uint32_t)((1000ull * TIMER_HZ + by / 2) / by);
}

void board_output(int32_t count)
{
    DAC1_CR &= ~TRIGGERED;
    DAC1_DHR12R1 = (uint32_t)(MIDDLE + count);
}

/* It goes out with the next trigger. */
static void hand_over(int32_t count)
{
    DAC1_DHR12R1 = (uint32_t)(MIDDLE + count);
    DAC1_CR |= TRIGGERED;
}

void board_start_sampling(uint32_t rate_mhz)
{
    rate = rate_mhz;
    done = 0;
    TIM6_ARR = divider(rate_mhz) - 1;
    TIM6_CR2 = 0;
    TIM6_EGR = BIT(0); /* takes PSC and ARR, and would trigger if it were let */
    TIM6_CR2 = 2u << 4; /* MMS: the update is the trigger */
    DMA1_LIFCR = 0x3Du;
    DMA1_STREAM(0, DMA_NDTR) = N_CHANNELS;
    /* PL, MSIZE and PSIZE of 16 bits, MINC, CIRC, TCIE, EN */
    DMA1_STREAM(0, DMA_CR) = 3u << 16 | 1u << 13 | 1u << 11 | BIT(10) | BIT(8) | BIT(4) | BIT(0);
    ADC1_CR |= BIT(2); /* ADSTART: waits for the trigger */
    hand_over(vl_output());
    TIM6_CNT = divider(rate_mhz) - 2; /* the first instant is two ticks away */
    began_us = board_clock_us();
    TIM6_CR1 = BIT(0);
}

void board_stop_sampling(void)
{
    TIM6_CR1 = 0;
    if (ADC1_CR & BIT(2)) {
        ADC1_CR |= BIT(4); /* ADSTP */
        WAIT_UNTIL(!(ADC1_CR & BIT(4)))
    }
    DMA1_STREAM(0, DMA_CR) = 0;
    WAIT_UNTIL(!(DMA1_STREAM(0, DMA_CR) & BIT(0)))
    DMA1_LIFCR = 0x3Du;
}

/* Instants that went by without their interrupt are told, by the clock: the DMA has overwritten their counts. */
static void tell_missed(void)
{
    const uint64_t passed = (board_clock_us() - began_us) * rate / 1000000000u;
    for (; done < passed; done++)
        vl_miss();
}

void converters_interrupt(void)
{
    DMA1_LIFCR = 0x3Du;
    if (!(TIM6_CR1 & BIT(0)))
        return; /* sampling has been stopped meanwhile */
    int32_t counts[N_CHANNELS];
    bool overload = false;
    for (unsigned channel = 0; channel < N_CHANNELS; channel++) {
        const uint16_t count = counts_in[channel];
        overload = overload || count == 0 || count == LAST;
        counts[channel] = MIDDLE_IN - (int32_t)count;
    }
    tell_missed();
    vl_input(counts, overload);
    done++;
    hand_over(vl_output());
}

void board_lock(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

void board_unlock(void)
{
    __asm__ volatile("cpsie i" ::: "memory");
}

bool board_stop_is_pressed(void)
{
    return GPIO('G', GPIO_IDR) & BIT(14); /* open, or no contact at all */
}
