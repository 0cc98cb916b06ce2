/* States, what has latched, and the watchdog. Every way out of ARMED leads to 0 V.
 *
 * State and latch change between board_lock and board_unlock, or in the sampling interrupt. What is static here ends in `locked`
 * where it may only be called so. */

#include "device.h"

static volatile enum vl_state state;
static volatile uint8_t latch;
static volatile bool has_changed;
static uint64_t fed_us;       /* when the watchdog was fed last */
static bool is_ramping;       /* the watchdog's ramp to 0 V is under way */
static int32_t ramp_from;     /* count that it begins with */
static uint64_t bitten_us;    /* when it begins */
static uint64_t ramp_instants; /* sample instants that it has had */
static uint64_t ramp_offset_us; /* from its beginning to the first of them */
static bool is_down;          /* the output was brought down since START or ARM, */
static uint64_t down_from;    /* from this sample on, */
static uint64_t down_samples; /* by a ramp of so many samples */

void vl_begin_life(void)
{
    state = VL_IDLE;
    latch = 0;
    has_changed = true;
    is_ramping = is_down = false;
}

enum vl_state vl_state(void)
{
    return state;
}

uint8_t vl_latched(void)
{
    return latch;
}

bool vl_take_change(void)
{
    board_lock();
    bool changed = has_changed;
    has_changed = false;
    board_unlock();
    return changed;
}

static void become_locked(enum vl_state next)
{
    has_changed = has_changed || state != next;
    state = next;
}

static void raise_locked(uint8_t flag)
{
    has_changed = has_changed || !(latch & flag);
    latch |= flag;
}

static void go_down_locked(uint64_t samples)
{
    is_down = true;
    down_from = vl_next_instant();
    down_samples = samples;
}

/* 0 V at once. */
static void drop_locked(enum vl_state next)
{
    is_ramping = false;
    vl_held = 0;
    board_output(0);
    go_down_locked(0);
    become_locked(next);
}

enum vl_status vl_start(uint32_t *value)
{
    if (state == VL_LATCHED) {
        *value = latch;
        return VL_IS_LATCHED;
    }
    if (state != VL_IDLE) {
        *value = state;
        return VL_WRONG_STATE;
    }
    *value = 0;
    board_lock();
    is_down = false;
    become_locked(VL_RUNNING);
    board_unlock();
    board_start_sampling(vl_in_force.rate_mhz);
    return VL_DONE;
}

void vl_stop_locked(void)
{
    drop_locked(state == VL_LATCHED ? VL_LATCHED : VL_IDLE);
}

enum vl_status vl_arm(uint32_t key, uint32_t *value)
{
    *value = 0;
    if (key != VL_ARM_KEY)
        return VL_NOT_ALLOWED;
    enum vl_status status = VL_DONE;
    board_lock();
    if (state == VL_RUNNING) {
        fed_us = board_clock_us();
        is_down = false;
        vl_forget_period_locked(vl_next_instant());
        become_locked(VL_ARMED);
    } else {
        status = state == VL_LATCHED ? VL_IS_LATCHED : VL_WRONG_STATE;
        *value = state == VL_LATCHED ? latch : state;
    }
    board_unlock();
    return status;
}

enum vl_status vl_disarm(uint32_t *value)
{
    board_lock();
    if (state == VL_ARMED)
        drop_locked(VL_RUNNING);
    else if (is_ramping)
        drop_locked(VL_LATCHED);
    board_unlock();
    *value = state;
    return VL_DONE;
}

enum vl_status vl_clear(uint32_t *value)
{
    if (latch && board_stop_is_pressed()) {
        *value = latch;
        return VL_IS_LATCHED;
    }
    board_lock();
    latch = 0;
    become_locked(VL_IDLE);
    board_unlock();
    *value = VL_IDLE;
    return VL_DONE;
}

void vl_emergency_stop_locked(void)
{
    vl_counters.emergency_stops++;
    raise_locked(VL_EMERGENCY_STOP);
    drop_locked(VL_LATCHED);
}

void vl_feed(void)
{
    board_lock();
    fed_us = board_clock_us();
    board_unlock();
}

static uint64_t instants_in(uint64_t microseconds)
{
    return (microseconds * vl_in_force.rate_mhz + 999999999) / 1000000000;
}

static uint64_t microseconds_of(uint64_t instants)
{
    return instants * 1000000000 / vl_in_force.rate_mhz;
}

void vl_watch(void)
{
    if (state != VL_ARMED || board_clock_us() < fed_us + vl_in_force.watchdog_us)
        return;
    vl_counters.watchdog_trips++;
    raise_locked(VL_WATCHDOG);
    if (vl_in_force.ramp_us == 0) {
        drop_locked(VL_LATCHED);
        return;
    }
    bitten_us = fed_us + vl_in_force.watchdog_us;
    ramp_from = vl_held;
    ramp_instants = 0;
    is_ramping = true;
    go_down_locked(instants_in(vl_in_force.ramp_us));
    become_locked(VL_LATCHED);
}

/* A straight line over ramp_us from where the output was when the watchdog bit. Sample instants are counted, for the clock says
 * little where a computer is late, and nothing in lockstep. */
bool vl_ramp(int32_t *count)
{
    if (!is_ramping)
        return false;
    if (ramp_instants == 0) {
        uint64_t since_us = board_clock_us() - bitten_us, period_us = microseconds_of(1);
        ramp_offset_us = since_us < period_us ? since_us : period_us;
    }
    uint64_t passed_us = ramp_offset_us + microseconds_of(ramp_instants++);
    is_ramping = passed_us < vl_in_force.ramp_us;
    if (!is_ramping)
        return false;
    int64_t ramp = vl_in_force.ramp_us, left = ramp_from * (ramp - (int64_t)passed_us);
    *count = (int32_t)((left + (left < 0 ? -ramp / 2 : ramp / 2)) / ramp);
    return true;
}

bool vl_is_coming_down(uint64_t index)
{
    return is_down && index < down_from + down_samples;
}
