/* The device: what has come is carried out, and what is due is sent. All of this runs in the main loop. */

#include <string.h>

#include "device.h"

enum { CONTROLS = 8 }; /* answers and heartbeats that wait for the wire */

static struct vl_command last_request, last_answer;
static bool has_last;

/* An answer or a heartbeat. */
struct control {
    bool is_heartbeat;
    struct vl_command answer;
    struct vl_heartbeat beat;
};

static struct control controls[CONTROLS];
static uint32_t n_controls;
static bool block_is_under_way; /* the oldest block was given to the wire */
static uint64_t beaten_us;
static uint32_t instants_seen;

static bool channels_fit(const struct vl_description *about)
{
    for (uint32_t i = 0; i < about->n_channels; i++) {
        const struct vl_channel *channel = &about->channels[i];
        if (!channel->name || !channel->name[0] || !(channel->range_v > 0.0f) || !(channel->v_per_count > 0.0f))
            return false;
    }
    return true;
}

static bool fits(const struct vl_description *about)
{
    return about->n_channels >= 1 && about->n_channels <= VL_MOST_CHANNELS && (about->bits == 16 || about->bits == 32)
           && about->bits / 8 <= VL_MOST_COUNT_BYTES && about->output_v_per_count > 0.0f && about->output_range_v > 0.0f
           && about->lowest_rate_mhz >= 1 && about->lowest_rate_mhz <= about->highest_rate_mhz
           && about->shortest_watchdog_us >= 1 && about->shortest_watchdog_us <= about->longest_watchdog_us
           && about->simulated <= 2 && channels_fit(about) && about->wire->fits(about);
}

bool vl_begin(const struct vl_description *description, uint32_t boot)
{
    board_output(0);
    if (!fits(description))
        return false;
    vl_about = description;
    vl_counters = (struct vl_counters){0};
    has_last = block_is_under_way = false;
    n_controls = 0;
    beaten_us = board_clock_us();
    instants_seen = 0;
    vl_about->wire->begin();
    vl_begin_parameters(boot);
    vl_begin_sampling();
    vl_begin_life();
    return vl_largest_block() >= 1;
}

/* -- what is sent ------------------------------------------------------------------------------------------------------ */

static void queue_control(const struct control *control)
{
    if (n_controls == CONTROLS) {
        vl_counters.lost_answers++;
        return;
    }
    controls[n_controls++] = *control;
}

static void queue_heartbeat(void)
{
    beaten_us = board_clock_us();
    queue_control(&(struct control){
        .is_heartbeat = true,
        .beat = {.state = (uint8_t)vl_state(),
                 .flags = vl_latched(),
                 .boot = (uint8_t)vl_boot,
                 .samples = (uint32_t)vl_handed_over(),
                 .dropped = vl_dropped()},
    });
}

static void send_control(void)
{
    struct control control = controls[0];
    n_controls--;
    memmove(controls, controls + 1, n_controls * sizeof *controls);
    if (control.is_heartbeat)
        vl_about->wire->send_heartbeat(&control.beat);
    else
        vl_about->wire->send_answer(&control.answer);
}

static void end_block_under_way(void)
{
    if (block_is_under_way)
        vl_forget_oldest_block(!vl_about->wire->has_expired());
    block_is_under_way = false;
}

/* As much as the wire takes. A heartbeat goes after all samples that it counts. */
static void send(void)
{
    while (vl_about->wire->is_idle()) {
        end_block_under_way();
        const struct vl_samples *block = vl_oldest_block();
        if (n_controls) {
            send_control();
        } else if (block) {
            block_is_under_way = true;
            vl_about->wire->send_samples(block);
        } else {
            return;
        }
    }
}

static void tell_of_a_change(void)
{
    if (vl_take_change())
        queue_heartbeat();
}

/* -- what has come ------------------------------------------------------------------------------------------------------ */

static enum vl_status start(uint32_t *value)
{
    if (vl_state() == VL_IDLE) {
        if (vl_settings.loop && !vl_tick_is_ready(value))
            return VL_NOT_ALLOWED;
        vl_in_force = vl_settings;
        vl_about->wire->configure();
        block_is_under_way = false;
        vl_restart_sampling();
    }
    return vl_start(value);
}

static enum vl_status stop(uint32_t *value)
{
    block_is_under_way = false;
    board_lock();
    vl_stop_locked();
    vl_end_sampling();
    board_unlock();
    board_stop_sampling();
    *value = vl_state();
    return VL_DONE;
}

/* A request that is for a device that does not sample. False: it samples, and the answer is its state. */
static bool is_at_rest(uint32_t *value)
{
    if (vl_is_sampling())
        *value = vl_state();
    return !vl_is_sampling();
}

/* The host asks the loop on the device for something. */
static enum vl_status ask_loop(void (*ask_locked)(void), uint32_t *value)
{
    if (!vl_is_sampling() || !vl_has_loop()) {
        *value = vl_state();
        return VL_WRONG_STATE;
    }
    *value = 0;
    board_lock();
    ask_locked();
    board_unlock();
    return VL_DONE;
}

static bool knows_loop(void)
{
    uint32_t value;
    return vl_tick_get(VL_P_LOOP, 0, &value);
}

static enum vl_status carry_out(const struct vl_command *request, uint32_t *value)
{
    *value = request->value;
    switch (request->code) {
    case VL_GET: return vl_get(request->parameter, request->item, value);
    case VL_SET: return is_at_rest(value) ? vl_set(request->parameter, request->item, value) : VL_WRONG_STATE;
    case VL_START: return start(value);
    case VL_STOP: return stop(value);
    case VL_ARM: return vl_arm(request->value, value);
    case VL_DISARM: return vl_disarm(value);
    case VL_CLEAR: return is_at_rest(value) ? vl_clear(value) : VL_WRONG_STATE;
    case VL_RAMP: if (knows_loop()) return ask_loop(vl_tick_ramp_locked, value); break;
    case VL_RELEASE: if (knows_loop()) return ask_loop(vl_tick_release_locked, value); break;
    default: break;
    }
    *value = 0;
    return VL_UNKNOWN;
}

static bool is_repeated(const struct vl_command *request)
{
    return has_last && request->number == last_request.number && request->code == last_request.code
           && request->parameter == last_request.parameter && request->item == last_request.item
           && request->value == last_request.value;
}

void vl_take_request(const struct vl_command *request)
{
    if (vl_is_sampling() && vl_has_loop())
        vl_feed(); /* the loop needs nothing of its host, but that it is there */
    if (is_repeated(request)) {
        vl_counters.repeated_requests++;
    } else {
        last_request = last_answer = *request;
        has_last = true;
        last_answer.code = (uint8_t)carry_out(request, &last_answer.value);
    }
    tell_of_a_change();
    queue_control(&(struct control){.answer = last_answer});
}

void vl_take_output(uint64_t first, const uint8_t *counts, uint32_t period, uint32_t ramp)
{
    if (!vl_is_sampling()) {
        vl_counters.outputs_while_idle++;
        return;
    }
    int32_t in_time = vl_has_loop() ? -1 : vl_keep_outputs(first, counts, vl_present());
    if (in_time < 0) {
        vl_counters.bad_outputs++;
        return;
    }
    vl_keep_period(first, counts, period, ramp);
    vl_note_an_output();
    if (in_time > 0)
        vl_feed();
    else
        vl_counters.late_outputs++;
}

void vl_take_emergency_stop(void)
{
    board_lock();
    vl_emergency_stop_locked();
    board_unlock();
    tell_of_a_change();
}

/* -- the main loop's part -------------------------------------------------------------------------------------------------- */

static void watch(void)
{
    if (board_stop_is_pressed() && !(vl_latched() & VL_EMERGENCY_STOP))
        vl_take_emergency_stop();
    board_lock();
    vl_watch();
    board_unlock();
    tell_of_a_change();
}

static void feed_the_chips_watchdog(void)
{
    uint32_t now = vl_instants();
    if (!vl_is_sampling() || now != instants_seen)
        board_feed_watchdog();
    instants_seen = now;
}

void vl_serve(void)
{
    watch();
    send();
    vl_about->wire->receive();
    send();
    if (board_clock_us() - beaten_us >= VL_HEARTBEAT_US)
        queue_heartbeat();
    send();
    feed_the_chips_watchdog();
}
