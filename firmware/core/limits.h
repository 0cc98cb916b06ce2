/* Sizes of the core's memory. A board sets others on the compiler's command line (-DVL_LARGEST_BLOCK=64). */

#ifndef VL_LIMITS_H
#define VL_LIMITS_H

/* Input channels, at most 31 by the protocol. */
#ifndef VL_MOST_CHANNELS
#define VL_MOST_CHANNELS 31
#endif

/* Samples a block; while the loop runs on the device, memory and wire alone bound it. */
#ifndef VL_LARGEST_BLOCK
#define VL_LARGEST_BLOCK 1000
#endif

/* Blocks between the handing over of an output and the converter. */
#ifndef VL_LARGEST_QUEUE
#define VL_LARGEST_QUEUE 64
#endif

/* Bytes of a count: 2, or 4 for converters of more than 16 bits. */
#ifndef VL_MOST_COUNT_BYTES
#define VL_MOST_COUNT_BYTES 4
#endif

/* Blocks beyond the queue by which a host may be early with its outputs. */
#define VL_BLOCKS_AHEAD 4

/* Bytes for the records of a run, where the loop is on the device (VL_HAS_TICK); a plan of ten points takes some 30 kB. */
#ifndef VL_TICK_BYTES
#define VL_TICK_BYTES 262144
#endif

/* Bytes for blocks that are measured and not sent yet; at least two blocks must fit. */
#ifndef VL_SAMPLE_BYTES
#define VL_SAMPLE_BYTES (3 * VL_LARGEST_BLOCK * VL_MOST_CHANNELS * VL_MOST_COUNT_BYTES)
#endif

/* Where the two largest buffers lie, blocks that wait and the frame that is sent: a section, for a chip whose fast memory is small. */
#ifndef VL_BULK
#define VL_BULK
#endif

/* Blocks that are measured and not sent yet, at most. */
#ifndef VL_MOST_BLOCKS
#define VL_MOST_BLOCKS 64
#endif

/* The longest period of a vibration that goes on where outputs are missing, samples; at most 65535, and 0 where they are held. The core
 * keeps twice as many outputs for it. */
#ifndef VL_LONGEST_PERIOD
#define VL_LONGEST_PERIOD 2048
#endif

/* The largest payload of the protocol on a serial line, bytes. */
#define VL_LARGEST_PAYLOAD 65536

/* Outputs that are kept until they are due. */
#define VL_OUTPUTS ((VL_LARGEST_QUEUE + VL_BLOCKS_AHEAD) * VL_LARGEST_BLOCK)

#endif
