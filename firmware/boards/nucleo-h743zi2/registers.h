/* The registers of an STM32H743 that this board uses. Addresses: RM0433 (STM32H742, H743/753 and H750 reference manual), memory map in
 * 2.3 and the register maps at the end of each chapter; those of the processor: Armv7-M architecture reference manual, B3. */

#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define BIT(n) (1u << (n))
/* Set a field of some bits. */
#define FIELD(of, mask, at, value) ((of) = ((of) & ~((uint32_t)(mask) << (at))) | ((uint32_t)(value) << (at)))

/* power, flash, clocks */
#define PWR_CR3 REGISTER(0x5802480Cu)
#define PWR_D3CR REGISTER(0x58024818u)
#define SYSCFG_PWRCR REGISTER(0x5800042Cu)
#define FLASH_ACR REGISTER(0x52002000u)
#define RCC_CR REGISTER(0x58024400u)
#define RCC_CFGR REGISTER(0x58024410u)
#define RCC_D1CFGR REGISTER(0x58024418u)
#define RCC_D2CFGR REGISTER(0x5802441Cu)
#define RCC_D3CFGR REGISTER(0x58024420u)
#define RCC_PLLCKSELR REGISTER(0x58024428u)
#define RCC_PLLCFGR REGISTER(0x5802442Cu)
#define RCC_PLL1DIVR REGISTER(0x58024430u)
#define RCC_D3CCIPR REGISTER(0x58024458u)
#define RCC_AHB1ENR REGISTER(0x580244D8u)
#define RCC_AHB2ENR REGISTER(0x580244DCu)
#define RCC_AHB4ENR REGISTER(0x580244E0u)
#define RCC_APB1LENR REGISTER(0x580244E8u)
#define RCC_APB4ENR REGISTER(0x580244F4u)

/* pins */
#define GPIO(port, offset) REGISTER(0x58020000u + 0x400u * (uint32_t)((port) - 'A') + (offset))
#define GPIO_MODER 0x00u
#define GPIO_PUPDR 0x0Cu
#define GPIO_IDR 0x10u
#define GPIO_AFRH 0x24u

/* converters and their timer */
#define ADC1_ISR REGISTER(0x40022000u)
#define ADC1_CR REGISTER(0x40022008u)
#define ADC1_CFGR REGISTER(0x4002200Cu)
#define ADC1_SMPR1 REGISTER(0x40022014u)
#define ADC1_SMPR2 REGISTER(0x40022018u)
#define ADC1_PCSEL REGISTER(0x4002201Cu)
#define ADC1_SQR1 REGISTER(0x40022030u)
#define ADC1_DR 0x40022040u
#define ADC12_CCR REGISTER(0x40022308u)
#define DAC1_CR REGISTER(0x40007400u)
#define DAC1_DHR12R1 REGISTER(0x40007408u)
#define TIM6_CR1 REGISTER(0x40001000u)
#define TIM6_CR2 REGISTER(0x40001004u)
#define TIM6_EGR REGISTER(0x40001014u)
#define TIM6_CNT REGISTER(0x40001024u)
#define TIM6_PSC REGISTER(0x40001028u)
#define TIM6_ARR REGISTER(0x4000102Cu)
#define TIM5_CR1 REGISTER(0x40000C00u)
#define TIM5_EGR REGISTER(0x40000C14u)
#define TIM5_CNT REGISTER(0x40000C24u)
#define TIM5_PSC REGISTER(0x40000C28u)
#define TIM5_ARR REGISTER(0x40000C2Cu)

/* DMA1: streams 0 to 2, and what asks for them */
#define DMA1_LISR REGISTER(0x40020000u)
#define DMA1_LIFCR REGISTER(0x40020008u)
#define DMA1_STREAM(n, offset) REGISTER(0x40020010u + 0x18u * (uint32_t)(n) + (offset))
#define DMA_CR 0x00u
#define DMA_NDTR 0x04u
#define DMA_PAR 0x08u
#define DMA_M0AR 0x0Cu
#define DMAMUX1(n) REGISTER(0x40020800u + 4u * (uint32_t)(n))

/* the serial line */
#define USART3_CR1 REGISTER(0x40004800u)
#define USART3_CR3 REGISTER(0x40004808u)
#define USART3_BRR REGISTER(0x4000480Cu)
#define USART3_RDR 0x40004824u
#define USART3_TDR 0x40004828u

/* random numbers, the chip's watchdog and its unique number */
#define RNG_CR REGISTER(0x48021800u)
#define RNG_SR REGISTER(0x48021804u)
#define RNG_DR REGISTER(0x48021808u)
#define IWDG1_KR REGISTER(0x58004800u)
#define IWDG1_PR REGISTER(0x58004804u)
#define IWDG1_RLR REGISTER(0x58004808u)
#define IWDG1_SR REGISTER(0x5800480Cu)
#define UNIQUE_NUMBER ((const volatile uint32_t *)0x1FF1E800u) /* 96 bits */

/* the processor */
#define NVIC_ISER0 REGISTER(0xE000E100u)
#define NVIC_IPR(n) (*(volatile uint8_t *)(0xE000E400u + (uint32_t)(n)))
#define SCB_VTOR REGISTER(0xE000ED08u)
#define SCB_AIRCR REGISTER(0xE000ED0Cu)
#define SCB_CCR REGISTER(0xE000ED14u)
#define SCB_CPACR REGISTER(0xE000ED88u)
#define SCB_ICIALLU REGISTER(0xE000EF50u)

#endif
